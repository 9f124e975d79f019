//! Reads a card's FAT32 volume, trusting nothing on it: every number is checked where it is used, every walk is
//! bounded, and what does not hold is told while everything that does hold is still read.
//!
//! Reading a whole card needs places (extents), not bytes, and needs the damage named; that is why this does not go
//! through `embedded-sdmmc`, whose reader stops at the first doubt.
//! Source of the layout: Microsoft FAT specification 1.03 (`fatgen103`).

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};

use hums_recorder::layout::Layout;

const BLOCK: u64 = 512;
const ENTRY_BYTES: usize = 32;
/// Directories deeper than this are not ours.
const DEPTH_MAX: usize = 8;
/// FAT32 allows no more entries in a directory.
const ENTRIES_MAX: usize = 65_536;
/// FAT entries that are read at once.
const WINDOW_BLOCKS: u32 = 128;
const ENTRIES_PER_BLOCK: u32 = 128;
const END_OF_CHAIN: u32 = 0x0fff_fff8;
const ENTRY_MASK: u32 = 0x0fff_ffff;

const ATTRIBUTE_VOLUME: u8 = 0x08;
const ATTRIBUTE_DIRECTORY: u8 = 0x10;
const ATTRIBUTE_LONG_NAME: u8 = 0x0f;

/// A run of bytes in the image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Extent {
    /// Where it begins, in bytes from the beginning of the image.
    pub start: u64,
    /// How long it is, in bytes.
    pub length: u64,
}

/// A file on the card.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CardFile {
    /// Its directories and its short name, for instance `LOGS/00042_07.HUM`.
    pub path: String,
    /// The short name's base, without its padding.
    pub base: Vec<u8>,
    /// The short name's extension, without its padding.
    pub extension: Vec<u8>,
    /// The size that the directory says, in bytes.
    pub size: u64,
    /// Where it lies; less than `size` where its chain is damaged.
    pub extents: Vec<Extent>,
}

/// What a walk over the volume found.
#[derive(Clone, Debug, Default)]
pub struct Walk {
    /// Every file, in directory order.
    pub files: Vec<CardFile>,
    /// What does not hold, as sentences.
    pub damage: Vec<String>,
    /// Clusters that are allocated and belong to no file: space that is lost, not data.
    pub lost_clusters: u64,
}

/// A FAT32 volume in an image.
pub struct Volume<'a> {
    image: &'a File,
    layout: Layout,
    root: u32,
    window: Option<(u32, Vec<u8>)>,
    /// One bit a cluster: already part of a file or directory.
    used: Vec<u64>,
    walk: Walk,
}

impl<'a> Volume<'a> {
    /// A volume whose layout was checked.
    pub fn new(image: &'a File, layout: Layout) -> io::Result<Self> {
        let mut root = [0; 4];
        read_at(image, u64::from(layout.start) * BLOCK + 44, &mut root)?;
        let words = (layout.clusters as usize + 2).div_ceil(64);
        let root = u32::from_le_bytes(root) & ENTRY_MASK;
        Ok(Self { image, layout, root, window: None, used: vec![0; words], walk: Walk::default() })
    }

    /// Walks over every directory.
    pub fn walk(mut self) -> io::Result<Walk> {
        self.directory(self.root, "", 0)?;
        self.count_lost()?;
        Ok(self.walk)
    }

    fn cluster_bytes(&self) -> u64 {
        u64::from(self.layout.cluster_blocks) * BLOCK
    }

    fn is_cluster(&self, cluster: u32) -> bool {
        cluster >= 2 && cluster - 2 < self.layout.clusters
    }

    fn place(&self, cluster: u32) -> u64 {
        u64::from(self.layout.data_start) * BLOCK + u64::from(cluster - 2) * self.cluster_bytes()
    }

    /// The FAT's entry for a cluster.
    fn entry(&mut self, cluster: u32) -> io::Result<u32> {
        let block = cluster / ENTRIES_PER_BLOCK;
        let first = block - block % WINDOW_BLOCKS;
        if self.window.as_ref().is_none_or(|(start, _)| *start != first) {
            let blocks = WINDOW_BLOCKS.min(self.layout.fat_blocks.saturating_sub(first));
            let mut bytes = vec![0; blocks as usize * BLOCK as usize];
            read_at(self.image, u64::from(self.layout.fat_start + first) * BLOCK, &mut bytes)?;
            self.window = Some((first, bytes));
        }
        let at = (cluster - first * ENTRIES_PER_BLOCK) as usize * 4;
        let bytes = self.window.as_ref().and_then(|(_, bytes)| bytes.get(at..at + 4));
        let raw = bytes.and_then(|bytes| bytes.try_into().ok()).map_or(0, u32::from_le_bytes);
        Ok(raw & ENTRY_MASK)
    }

    /// Marks a cluster as used; false where it already was.
    fn claim(&mut self, cluster: u32) -> bool {
        let (word, bit) = (cluster as usize / 64, 1_u64 << (cluster % 64));
        match self.used.get_mut(word) {
            Some(word) if *word & bit == 0 => {
                *word |= bit;
                true
            }
            _ => false,
        }
    }

    /// The clusters from `first` on, joined to runs, `clusters_max` at most. Ends at the first doubt, which is told.
    fn chain(&mut self, first: u32, clusters_max: u64, what: &str) -> io::Result<Vec<Extent>> {
        let mut extents: Vec<Extent> = Vec::new();
        let mut cluster = first;
        let mut count = 0;
        while cluster < END_OF_CHAIN {
            if !self.is_cluster(cluster) {
                self.walk.damage.push(format!("{what}: its chain leads to cluster {cluster}, which is none"));
                break;
            }
            if !self.claim(cluster) {
                self.walk.damage.push(format!("{what}: cluster {cluster} belongs to something else as well"));
                break;
            }
            if count == clusters_max {
                self.walk.damage.push(format!("{what}: its chain is longer than its size"));
                break;
            }
            count += 1;
            let (start, length) = (self.place(cluster), self.cluster_bytes());
            match extents.last_mut() {
                Some(last) if last.start + last.length == start => last.length += length,
                _ => extents.push(Extent { start, length }),
            }
            cluster = self.entry(cluster)?;
        }
        Ok(extents)
    }

    fn directory(&mut self, first: u32, path: &str, depth: usize) -> io::Result<()> {
        let what = if path.is_empty() { "the root directory" } else { path };
        let bytes_max = (ENTRIES_MAX * ENTRY_BYTES) as u64;
        let extents = self.chain(first, bytes_max.div_ceil(self.cluster_bytes()), what)?;
        let mut children = Vec::new();
        'extents: for extent in extents {
            let mut bytes = vec![0; usize::try_from(extent.length.min(bytes_max)).unwrap_or(0)];
            read_at(self.image, extent.start, &mut bytes)?;
            for entry in bytes.chunks_exact(ENTRY_BYTES) {
                match Entry::read(entry) {
                    Some(Entry::End) => break 'extents,
                    Some(Entry::Child(child)) => children.push(child),
                    None => {}
                }
            }
        }
        for child in children {
            self.child(child, path, depth)?;
        }
        Ok(())
    }

    fn child(&mut self, child: Child, path: &str, depth: usize) -> io::Result<()> {
        let name = child.name();
        let path = if path.is_empty() { name } else { format!("{path}/{name}") };
        if child.is_directory {
            if depth >= DEPTH_MAX {
                self.walk.damage.push(format!("{path}: directories deeper than {DEPTH_MAX} are not read"));
                return Ok(());
            }
            return self.directory(child.first, &path, depth + 1);
        }
        let size = u64::from(child.size);
        let mut extents = match child.first {
            0 => Vec::new(),
            first => self.chain(first, size.div_ceil(self.cluster_bytes()), &path)?,
        };
        let mut left = size;
        for extent in &mut extents {
            extent.length = extent.length.min(left);
            left -= extent.length;
        }
        if left > 0 {
            self.walk.damage.push(format!("{path}: the last {left} of its {size} bytes have no cluster"));
        }
        self.walk.files.push(CardFile { path, base: child.base, extension: child.extension, size, extents });
        Ok(())
    }

    fn count_lost(&mut self) -> io::Result<()> {
        for cluster in 2..self.layout.clusters + 2 {
            let used =
                self.used.get(cluster as usize / 64).is_some_and(|word| word & (1 << (cluster % 64)) != 0);
            // 0x0ffffff7 marks a bad cluster.
            if !used && !matches!(self.entry(cluster)?, 0 | 0x0fff_fff7) {
                self.walk.lost_clusters += 1;
            }
        }
        Ok(())
    }
}

enum Entry {
    End,
    Child(Child),
}

struct Child {
    base: Vec<u8>,
    extension: Vec<u8>,
    is_directory: bool,
    first: u32,
    size: u32,
}

impl Entry {
    /// `None` for what is no file and no directory: deleted, long-name parts, the volume's label, `.` and `..`.
    fn read(entry: &[u8]) -> Option<Self> {
        let entry: &[u8; ENTRY_BYTES] = entry.try_into().ok()?;
        let attributes = entry[11];
        match entry[0] {
            0 => return Some(Self::End),
            0xe5 | b'.' => return None,
            _ if attributes & ATTRIBUTE_LONG_NAME == ATTRIBUTE_LONG_NAME
                || attributes & ATTRIBUTE_VOLUME != 0 =>
            {
                return None;
            }
            _ => {}
        }
        let trimmed = |bytes: &[u8]| bytes.trim_ascii_end().to_vec();
        Some(Self::Child(Child {
            base: trimmed(&entry[..8]),
            extension: trimmed(&entry[8..11]),
            is_directory: attributes & ATTRIBUTE_DIRECTORY != 0,
            first: u32::from_le_bytes([entry[26], entry[27], entry[20], entry[21]]) & ENTRY_MASK,
            size: u32::from_le_bytes([entry[28], entry[29], entry[30], entry[31]]),
        }))
    }
}

impl Child {
    fn name(&self) -> String {
        // Only what is safe in a path of this PC.
        let safe = |bytes: &[u8]| -> String {
            let keep = |byte: &u8| byte.is_ascii_alphanumeric() || b"_-~".contains(byte);
            bytes.iter().map(|byte| if keep(byte) { char::from(*byte) } else { '_' }).collect()
        };
        match self.extension.as_slice() {
            [] => safe(&self.base),
            extension => format!("{}.{}", safe(&self.base), safe(extension)),
        }
    }
}

/// Reads all of `buffer` from this place; what lies beyond the image's end reads as zeros (a cut image).
pub fn read_at(mut image: &File, start: u64, buffer: &mut [u8]) -> io::Result<()> {
    image.seek(SeekFrom::Start(start))?;
    let mut filled = 0;
    while let Some(rest) = buffer.get_mut(filled..).filter(|rest| !rest.is_empty()) {
        match image.read(rest) {
            Ok(0) => {
                rest.fill(0);
                return Ok(());
            }
            Ok(got) => filled += got,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(())
}
