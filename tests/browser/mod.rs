//! The check, the report and the live page in a browser: they show the flight as it was.

#[cfg(feature = "browser")]
mod check;
#[cfg(feature = "browser")]
mod live;
#[cfg(feature = "browser")]
mod report;
