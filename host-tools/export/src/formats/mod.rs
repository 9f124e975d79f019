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
pub(crate) mod ulog;

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

#[cfg(test)]
fn table() -> String {
    use std::fmt::Write as _;

    use crate::format::Files;

    let mut table = String::from("| format | content | file | cannot hold |\n|---|---|---|---|\n");
    for about in FORMATS.iter().map(|format| format.about) {
        let file = match about.files {
            Files::One(extension) => format!("OUT/LOG.{extension}"),
            Files::Tables(None, extension) => format!("OUT/LOG/TABLE.{extension}"),
            Files::Tables(Some(folder), extension) => format!("OUT/LOG.{folder}/TABLE.{extension}"),
            Files::Fleet(extension) => format!("OUT/TABLE/date=D/bucket=B/SESSION.{extension}"),
        };
        let (name, help, omits) = (about.name, about.help, about.omits);
        writeln!(table, "| [`{name}`](#{name}) | {help} | `{file}` | {omits} |").expect("a string");
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_document_has_the_table_of_formats() {
        let document = include_str!("../../../../docs/decode.md");
        assert!(document.contains(&table()), "docs/decode.md should have this table:\n{}", table());
        for format in &FORMATS {
            let name = format.about.name;
            assert!(document.contains(&format!("\n## {name}\n")), "docs/decode.md has no section {name}");
        }
    }
}
