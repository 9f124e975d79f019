//! The table of formats, and a file for each.

mod csv;
mod gpx;
pub mod hum;
pub mod influx;
mod jsonl;
mod kml;
mod mcap;
pub(crate) mod parquet;
mod srt;
mod thesis;
mod tlog;
mod ulog;

use crate::format::Format;

/// All formats, in the order of help and documentation.
pub static FORMATS: [Format; 12] = [
    Format::of::<tlog::Tlog>(),
    Format::of::<csv::Csv>(),
    Format::of::<jsonl::Jsonl>(),
    Format::of::<influx::Influx>(),
    Format::of::<parquet::Parquet>(),
    Format::of::<mcap::Mcap>(),
    Format::of::<ulog::Ulog>(),
    Format::of::<kml::Kml>(),
    Format::of::<gpx::Gpx>(),
    Format::of::<srt::Srt>(),
    hum::FORMAT,
    Format::of::<thesis::Thesis>(),
];

/// The format of this name.
pub fn find(name: &str) -> Option<&'static Format> {
    FORMATS.iter().find(|format| format.about.name == name)
}
