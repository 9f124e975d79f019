//! Limits of entries.

use hums_dialect::wire::FRAME_BYTES_MAX;

/// Kind and version included; longer ones are refused (`TooLong`).
pub const RECORD_BYTES_MAX: usize = 512;

/// Text (a message, a note) in a record; longer ones are cut at a character's border.
pub const TEXT_BYTES_MAX: usize = 200;

/// Name (a version, a parameter, a source's place) in a record; longer ones are cut likewise.
pub const NAME_BYTES_MAX: usize = 96;

pub(crate) const ENTRY_BYTES_MAX: usize =
    if FRAME_BYTES_MAX > RECORD_BYTES_MAX { FRAME_BYTES_MAX } else { RECORD_BYTES_MAX };
