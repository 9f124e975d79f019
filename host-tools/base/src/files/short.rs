//! Short files that are read whole: parameters, a key, a firmware image.

use std::fs::File;
use std::io::Read as _;
use std::path::Path;

use anyhow::{Context as _, Result, bail};

/// All bytes of a file or a pipe of at most `most` bytes. A longer one is refused before more of it is read, so that
/// a wrong file cannot fill this PC's memory.
pub fn read_short(path: &Path, most: u64) -> Result<Vec<u8>> {
    let context = || format!("{}: cannot be read", path.display());
    let file = File::open(path).with_context(context)?;
    let mut bytes = Vec::new();
    file.take(most + 1).read_to_end(&mut bytes).with_context(context)?;
    if bytes.len() as u64 > most {
        bail!("{}: has more than {most} bytes, which no such file has; name another file", path.display());
    }
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn a_file_that_is_too_long_is_refused_and_one_without_an_end_too() {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("file");
        fs::write(&path, [7; 100]).expect("written");
        assert_eq!(read_short(&path, 100).expect("it fits"), [7; 100]);
        let error = read_short(&path, 99).expect_err("it does not").to_string();
        assert!(error.contains("file: has more than 99 bytes"), "{error}");
        if cfg!(unix) {
            assert!(read_short(Path::new("/dev/zero"), 1 << 20).is_err());
        }
    }
}
