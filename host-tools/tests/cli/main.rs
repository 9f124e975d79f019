//! The program as a user runs it.
#![expect(clippy::panic, reason = "a test that cannot go on says why")]

mod check;
mod compact;
mod copied;
mod copies;
mod damaged;
mod due;
mod field;
mod folders;
mod formats;
mod help;
mod images;
mod in_place;
mod inputs;
mod json;
mod killed;
mod logbook;
mod mixed;
mod pairs;
mod read;
mod record;
mod replace;
mod shell;
mod support;
mod trends;
