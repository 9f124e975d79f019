//! The check, the report and the live page in a browser: they show the flight as it was.

mod check;
mod live;
mod report;
