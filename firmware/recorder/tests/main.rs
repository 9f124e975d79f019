//! The recorder and its card layer, on a card in memory.

mod card;
mod common;
mod recorder;
