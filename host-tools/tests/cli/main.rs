//! The program as a user runs it.
#![allow(clippy::panic, reason = "a test that cannot go on says why")]

mod read;
mod record;
mod support;
