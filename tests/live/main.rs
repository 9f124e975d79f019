//! `hums live --influx` with real databases: every point arrives, whatever happens to the database meanwhile; and the
//! dashboards ask for what is there.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

#[cfg(feature = "databases")]
mod answers;
#[cfg(feature = "databases")]
mod database;
mod grafana;
#[cfg(feature = "databases")]
mod writes;
