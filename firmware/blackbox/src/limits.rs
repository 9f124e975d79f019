//! Limits of entries.

use hums_dialect::wire::FRAME_BYTES_MAX;

/// The longest stored record, kind and version included. A longer one is refused (`TooLong`).
pub const RECORD_BYTES_MAX: usize = 512;

/// The longest text (a message, a note) in a record; longer ones are cut at a character's border.
pub const TEXT_BYTES_MAX: usize = 200;

/// The longest name (a version, a parameter, a place in the source) in a record; longer ones are cut likewise.
pub const NAME_BYTES_MAX: usize = 96;

/// The longest entry: a frame or a record.
pub(crate) const ENTRY_BYTES_MAX: usize =
    if FRAME_BYTES_MAX > RECORD_BYTES_MAX { FRAME_BYTES_MAX } else { RECORD_BYTES_MAX };
