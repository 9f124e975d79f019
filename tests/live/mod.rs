//! `hums live --influx` with real databases: every point arrives despite failures of the database, and the dashboards
//! query existing data.

#[cfg(feature = "databases")]
mod answers;
#[cfg(feature = "databases")]
mod database;
mod grafana;
#[cfg(feature = "databases")]
mod writes;
