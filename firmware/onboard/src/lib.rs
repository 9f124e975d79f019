//! The pipeline between the ports and the card, with time and I/O as arguments.
