//! A recording's bytes, plain or gzip, with progress.
//!
//! Damaged compressed bytes end the input; [`Progress::damage`] has place and reason.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Cursor, Read};
use std::path::Path;
use std::sync::Arc;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use anyhow::{Context as _, Result};
use flate2::bufread::GzDecoder;

use super::stream::read_some;
use crate::archive::GZIP;

const BUFFER_BYTES: usize = 64 * 1024;

/// Shared by clones.
#[derive(Clone, Debug, Default)]
pub struct Progress(Arc<State>);

#[derive(Debug, Default)]
struct State {
    taken: AtomicU64,
    /// 0 if unknown.
    total: AtomicU64,
    damage: Mutex<Option<String>>,
}

impl Progress {
    /// Bytes read, before unpacking.
    pub fn taken(&self) -> u64 {
        self.0.taken.load(Ordering::Relaxed)
    }

    /// Bytes, if known.
    pub fn total(&self) -> Option<u64> {
        Some(self.0.total.load(Ordering::Relaxed)).filter(|total| *total > 0)
    }

    /// 0 to 1; 0 if the size is unknown.
    pub fn part(&self) -> f64 {
        self.total().map_or(0.0, |total| (self.taken() as f64 / total as f64).min(1.0))
    }

    /// Damage of the compressed bytes, if any.
    pub fn damage(&self) -> Option<String> {
        self.0.damage.lock().ok()?.clone()
    }

    /// Total bytes.
    pub fn set_total(&self, bytes: u64) {
        self.0.total.store(bytes, Ordering::Relaxed);
    }

    /// Bytes read.
    pub fn set_taken(&self, bytes: u64) {
        self.0.taken.store(bytes, Ordering::Relaxed);
    }

    fn set_damage(&self, words: String) {
        if let Ok(mut damage) = self.0.damage.lock() {
            damage.get_or_insert(words);
        }
    }
}

/// Keeps only the present chunk.
pub struct Input {
    inner: Box<dyn Read + Send>,
    progress: Progress,
    compressed: bool,
}

impl Input {
    /// Opens a file.
    pub fn open(path: &Path) -> Result<Self> {
        let context = || format!("{}: cannot be opened", path.display());
        let file = File::open(path).with_context(context)?;
        let bytes = file.metadata().with_context(context)?.len();
        let input = Self::new(file).with_context(|| format!("{}: cannot be read", path.display()))?;
        input.progress.set_total(bytes);
        Ok(input)
    }

    /// The bytes of `inner`: standard input, memory.
    pub fn new(inner: impl Read + Send + 'static) -> io::Result<Self> {
        let progress = Progress::default();
        let mut counted = Counted { inner, progress: progress.clone() };
        let start = read_start(&mut counted, GZIP.len())?;
        let compressed = start == GZIP;
        let whole = Cursor::new(start).chain(counted);
        let inner: Box<dyn Read + Send> = if compressed {
            Box::new(Members(Some(GzDecoder::new(BufReader::with_capacity(BUFFER_BYTES, whole)))))
        } else {
            Box::new(whole)
        };
        Ok(Self { inner, progress, compressed })
    }

    /// Unpacked bytes, as far as readable.
    pub fn bytes_of(path: &Path) -> u64 {
        match Self::open(path) {
            Ok(mut input) if input.compressed => io::copy(&mut input, &mut io::sink()).unwrap_or(u64::MAX),
            Ok(input) => input.progress.total().unwrap_or(0),
            Err(_) => 0,
        }
    }

    /// Progress of reading.
    pub fn progress(&self) -> Progress {
        self.progress.clone()
    }

    /// Fewer at the end; puts them back.
    pub fn peek(&mut self, bytes: usize) -> io::Result<Vec<u8>> {
        let start = read_start(self, bytes)?;
        let rest = std::mem::replace(&mut self.inner, Box::new(io::empty()));
        self.inner = Box::new(Cursor::new(start.clone()).chain(rest));
        Ok(start)
    }
}

impl Read for Input {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        match self.inner.read(buffer) {
            Err(error) if self.compressed && is_damage(&error) => {
                let place = self.progress.taken();
                self.progress.set_damage(match error.kind() {
                    io::ErrorKind::UnexpectedEof => {
                        format!("the compressed file ends too soon, after {place} bytes")
                    }
                    _ => format!("the compressed file is damaged before byte {place}: {error}"),
                });
                self.inner = Box::new(io::empty());
                Ok(0)
            }
            result => result,
        }
    }
}

/// The decoder's, not the file system's.
fn is_damage(error: &io::Error) -> bool {
    use io::ErrorKind::{InvalidData, InvalidInput, UnexpectedEof};
    matches!(error.kind(), InvalidData | InvalidInput | UnexpectedEof)
}

/// Fewer at the end.
fn read_start(input: &mut impl Read, bytes: usize) -> io::Result<Vec<u8>> {
    let (mut start, mut filled) = (vec![0; bytes], 0);
    while filled < bytes {
        match read_some(input, start.get_mut(filled..).unwrap_or_default())? {
            0 => break,
            got => filled += got,
        }
    }
    start.truncate(filled);
    Ok(start)
}

/// Members of a gzip file. Zeros behind one are a tape's or a device's padding, as for `gzip`.
struct Members<R>(Option<GzDecoder<R>>);

impl<R: BufRead> Read for Members<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if buffer.is_empty() {
            return Ok(0);
        }
        while let Some(member) = &mut self.0 {
            let got = member.read(buffer)?;
            if got > 0 {
                return Ok(got);
            }
            let is_end = loop {
                let rest = member.get_mut().fill_buf()?;
                let zeros = rest.iter().take_while(|&&byte| byte == 0).count();
                if zeros == 0 {
                    break rest.is_empty();
                }
                member.get_mut().consume(zeros);
            };
            let rest = self.0.take().filter(|_| !is_end);
            self.0 = rest.map(|member| GzDecoder::new(member.into_inner()));
        }
        Ok(0)
    }
}

struct Counted<R> {
    inner: R,
    progress: Progress,
}

impl<R: Read> Read for Counted<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let got = self.inner.read(buffer)?;
        self.progress.0.taken.fetch_add(got as u64, Ordering::Relaxed);
        Ok(got)
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write as _;

    use flate2::Compression;
    use flate2::write::GzEncoder;

    use super::*;

    fn packed(bytes: &[u8]) -> Vec<u8> {
        let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
        encoder.write_all(bytes).expect("memory");
        encoder.finish().expect("memory")
    }

    fn read(bytes: Vec<u8>) -> (Vec<u8>, Option<String>) {
        let mut input = Input::new(Cursor::new(bytes)).expect("memory");
        let peeked = input.peek(1000).expect("memory");
        let mut all = Vec::new();
        input.read_to_end(&mut all).expect("damage is no error");
        assert!(all.starts_with(&peeked), "what was looked at is put back");
        (all, input.progress().damage())
    }

    fn sample() -> Vec<u8> {
        (0..200_000_u32).flat_map(|number| (number.wrapping_mul(2_654_435_761) >> 9).to_le_bytes()).collect()
    }

    #[test]
    fn compressed_or_not_the_bytes_are_the_same() {
        let plain = sample();
        assert_eq!(read(plain.clone()), (plain.clone(), None));
        assert_eq!(read(packed(&plain)), (plain.clone(), None));
        let padded = [packed(&plain), vec![0; 100_000]].concat();
        assert_eq!(read(padded.clone()), (plain.clone(), None), "padding");
        assert!(read([padded, vec![1]].concat()).1.is_some(), "what is behind it");
        let two = [packed(&plain), packed(b"more")].concat();
        assert_eq!(read(two), ([&plain[..], b"more"].concat(), None), "members follow each other");
        assert_eq!(read(Vec::new()), (Vec::new(), None));
        assert_eq!(read(vec![0x1f]), (vec![0x1f], None));
    }

    #[test]
    fn a_cut_compressed_file_gives_what_it_has_and_says_where_it_ends() {
        let (plain, whole) = (sample(), packed(&sample()));
        let (got, damage) = read(whole[..whole.len() / 2].to_vec());
        assert!(plain.starts_with(&got) && got.len() > plain.len() / 4, "{}", got.len());
        let damage = damage.expect("it is said");
        assert!(damage.contains(&format!("after {} bytes", whole.len() / 2)), "{damage}");
    }

    #[test]
    fn a_damaged_compressed_file_is_no_error_either() {
        let mut bytes = packed(&sample());
        let middle = bytes.len() / 2;
        bytes[middle..middle + 64].fill(0xff);
        assert!(read(bytes).1.is_some());
    }
}
