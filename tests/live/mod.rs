//! `hums live --influx` with real databases.

#[cfg(feature = "databases")]
mod answers;
#[cfg(feature = "databases")]
mod database;
mod grafana;
#[cfg(feature = "databases")]
mod writes;
