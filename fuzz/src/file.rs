//! Bytes as a file, for readers that take a path.

use std::io::Write as _;
use std::path::Path;

use tempfile::NamedTempFile;

/// Calls `look` with a file that holds `bytes` and goes afterwards.
///
/// # Panics
/// If no temporary file can be made.
pub fn with_file<R>(bytes: &[u8], look: impl FnOnce(&Path) -> R) -> R {
    let mut file = NamedTempFile::new().expect("a temporary file");
    file.write_all(bytes).expect("room for it");
    look(file.path())
}
