//! `hums live --influx` with real databases: every point arrives despite failures of the database, and the dashboards
//! query existing data.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

#[cfg(feature = "databases")]
mod answers;
#[cfg(feature = "databases")]
mod database;
mod grafana;
#[cfg(feature = "databases")]
mod writes;
