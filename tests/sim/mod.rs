//! The `hums` command as for a user, with recorded flights at the UART; each module is one promise.

mod any_log;
mod board;
mod budget;
mod card_trouble;
mod companion;
mod downlink;
mod ending;
mod file_dates;
mod folders;
mod hostile_input;
mod live_server;
mod memory;
mod metadata;
mod noise;
mod persistence;
mod protection;
mod pull;
mod raw_device;
mod round_trip;
mod salvage;
mod second_decoder;
mod setup;
mod texts;
mod usage;
