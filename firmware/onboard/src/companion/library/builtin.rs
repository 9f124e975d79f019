//! Files that the firmware holds itself: MAVLink's component information
//! (<https://mavlink.io/en/services/component_information.html>), by which a ground station shows our settings with
//! their words, units and ranges.
//!
//! `firmware/onboard/metadata` has them as they are sent; `tests/sim/metadata.rs` makes them from the table of
//! parameters, and fails if they differ from it.

use hums_link::ftp;

/// Sent in `COMPONENT_METADATA`.
pub(in crate::companion) const GENERAL_URI: &str = "mftp://[;comp=191]/general.json";

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::companion) enum BuiltinFile {
    /// The list of the others (`COMP_METADATA_TYPE_GENERAL`).
    General,
    /// The parameters (`COMP_METADATA_TYPE_PARAMETER`), packed with xz.
    Parameters,
}

impl BuiltinFile {
    pub(super) fn named(path: &str) -> Option<Self> {
        match path.strip_prefix('/').unwrap_or(path) {
            "general.json" => Some(Self::General),
            "parameters.json.xz" => Some(Self::Parameters),
            _ => None,
        }
    }

    /// Its content.
    pub(super) const fn bytes(self) -> &'static [u8] {
        match self {
            Self::General => include_bytes!("../../../metadata/general.json"),
            Self::Parameters => include_bytes!("../../../metadata/parameters.json.xz"),
        }
    }

    /// A ground station recognises a known version by it.
    pub(in crate::companion) const fn crc(self) -> u32 {
        const GENERAL: u32 = ftp::checksum_of(BuiltinFile::General.bytes());
        const PARAMETERS: u32 = ftp::checksum_of(BuiltinFile::Parameters.bytes());
        match self {
            Self::General => GENERAL,
            Self::Parameters => PARAMETERS,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_general_file_names_the_other_one_with_its_checksum() {
        let general = core::str::from_utf8(BuiltinFile::General.bytes()).expect("text");
        assert!(general.contains(&format!("\"fileCrc\":{}", BuiltinFile::Parameters.crc())), "{general}");
        let uri =
            general.split("\"uri\":\"").nth(1).and_then(|rest| rest.split('"').next()).expect("an address");
        let path = |uri: &str| uri.strip_prefix("mftp://[;comp=191]").map(str::to_owned).expect("ours");
        assert_eq!(BuiltinFile::named(&path(uri)), Some(BuiltinFile::Parameters));
        assert_eq!(BuiltinFile::named(&path(GENERAL_URI)), Some(BuiltinFile::General));
        assert_eq!(BuiltinFile::named("/00001_00.HUM"), None);
        assert_eq!(ftp::checksum(0, BuiltinFile::Parameters.bytes()), BuiltinFile::Parameters.crc());
    }
}
