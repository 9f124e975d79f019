//! The hums command.
