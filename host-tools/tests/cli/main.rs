//! The program as a user runs it.
#![expect(clippy::panic, reason = "a test that cannot go on says why")]

mod check;
mod files;
mod help;
mod in_place;
mod read;
mod record;
mod support;
