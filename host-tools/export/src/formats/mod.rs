//! The table of formats, and a file for each.

mod csv;
pub mod hum;
pub mod influx;
mod jsonl;
pub(crate) mod parquet;
mod thesis;
mod tlog;

use crate::format::Format;

/// All formats, in the order of help and documentation.
pub static FORMATS: [Format; 7] = [
    Format::of::<tlog::Tlog>(),
    Format::of::<csv::Csv>(),
    Format::of::<jsonl::Jsonl>(),
    Format::of::<influx::Influx>(),
    Format::of::<parquet::Parquet>(),
    hum::FORMAT,
    Format::of::<thesis::Thesis>(),
];

/// The format of this name.
pub fn find(name: &str) -> Option<&'static Format> {
    FORMATS.iter().find(|format| format.about.name == name)
}
