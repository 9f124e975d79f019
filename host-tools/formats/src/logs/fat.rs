//! Reads a card's FAT32 volume and trusts nothing on it: every number is checked, every walk bounded. Damage is reported, and
//! sound parts are read.
//!
//! Source of the layout: Microsoft FAT specification 1.03 (`fatgen103`).
//!
//! Memory: a bit for each cluster (32 MiB for the largest volume of FAT32), 64 KiB of the FAT, and at most `FILES_MAX` files in
//! `EXTENTS_MAX` extents: 10 MiB and 16 MiB.

use std::fmt;
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};

use hums_blackbox::Header;
use hums_recorder::LogName;
use hums_recorder::layout::Layout;

const BLOCK: u64 = 512;
const ENTRY_BYTES: usize = 32;
/// Directories deeper than this are not ours.
const DEPTH_MAX: usize = 8;
/// FAT32's own limit.
const ENTRIES_MAX: usize = 65_536;
/// Files of one full directory; the recorder uses one.
const FILES_MAX: usize = ENTRIES_MAX;
/// Of all segments together. The recorder allocates a segment in a few runs.
const EXTENTS_MAX: usize = 1 << 20;
/// Kept sentences.
const DAMAGE_MAX: usize = 20;
/// Bytes at once.
const READ_BYTES: u64 = 64 * 1024;
const WINDOW_BLOCKS: u32 = 128;
const ENTRIES_PER_BLOCK: u32 = 128;
const END_OF_CHAIN: u32 = 0x0fff_fff8;
const ENTRY_MASK: u32 = 0x0fff_ffff;

const DELETED: u8 = 0xe5;
const ATTRIBUTE_VOLUME: u8 = 0x08;
const ATTRIBUTE_DIRECTORY: u8 = 0x10;
const ATTRIBUTE_LONG_NAME: u8 = 0x0f;

/// A run of bytes in the image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Extent {
    /// Bytes from the image's beginning.
    pub start: u64,
    /// Length, bytes.
    pub length: u64,
}

/// A segment, or a log under another name.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CardFile {
    /// Directories and short name: `LOGS/00042_07.HUM`.
    pub path: String,
    /// Session and segment; `None` for another name whose first block is a log's sector.
    pub name: Option<LogName>,
    /// The size by the directory, in bytes.
    pub size: u64,
    /// Less than `size` if its chain is damaged.
    pub extents: Vec<Extent>,
}

/// Result of a walk over the volume.
#[derive(Clone, Debug, Default)]
pub struct Walk {
    /// Segments and other files that begin with a log's sector, in directory order, up to `FILES_MAX`; the rest is only checked.
    pub files: Vec<CardFile>,
    /// Damage, as sentences: the first `DAMAGE_MAX`, then one that counts the others.
    pub damage: Vec<String>,
    /// Clusters that are free.
    pub free_clusters: u64,
    /// Clusters without a file: a power cut, or a lost entry.
    pub lost_clusters: u64,
    /// Their places, as far as there is room.
    pub lost: Vec<Extent>,
    /// Their first cluster is free and begins with a log's sector.
    pub deleted_logs: u64,
}

/// An image file, a raw device or memory.
pub trait ReadAt {
    /// Bytes beyond the end read as zeros (a cut image).
    fn read_at(&self, start: u64, buffer: &mut [u8]) -> io::Result<()>;
}

impl ReadAt for File {
    fn read_at(&self, start: u64, buffer: &mut [u8]) -> io::Result<()> {
        let mut file = self;
        file.seek(SeekFrom::Start(start))?;
        let mut filled = 0;
        while let Some(rest) = buffer.get_mut(filled..).filter(|rest| !rest.is_empty()) {
            match file.read(rest) {
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
}

/// A FAT32 volume in an image.
pub struct Volume<'a, I> {
    image: &'a I,
    layout: Layout,
    root: u32,
    window: Option<(u32, Vec<u8>)>,
    /// A bit for each cluster in use.
    used: Vec<u64>,
    walk: Walk,
    extents: usize,
    /// Segments beyond [`FILES_MAX`], and damage beyond [`DAMAGE_MAX`].
    files_more: u64,
    damage_more: u64,
}

impl<'a, I: ReadAt> Volume<'a, I> {
    /// A volume whose layout was checked.
    pub fn new(image: &'a I, layout: Layout) -> io::Result<Self> {
        let mut root = [0; 4];
        image.read_at(u64::from(layout.start) * BLOCK + 44, &mut root)?;
        let words = (layout.clusters as usize + 2).div_ceil(64);
        let root = u32::from_le_bytes(root) & ENTRY_MASK;
        Ok(Self {
            image,
            layout,
            root,
            window: None,
            used: vec![0; words],
            walk: Walk::default(),
            extents: 0,
            files_more: 0,
            damage_more: 0,
        })
    }

    /// Walks over every directory.
    pub fn walk(mut self) -> io::Result<Walk> {
        self.directory(self.root, "", 0)?;
        self.count_lost()?;
        if self.files_more > 0 {
            self.damaged(format!("{} log segments beyond {FILES_MAX} are left out", self.files_more));
        }
        if self.damage_more > 0 {
            self.walk.damage.push(format!("and {} more that do not hold", self.damage_more));
        }
        Ok(self.walk)
    }

    fn damaged(&mut self, sentence: String) {
        if self.walk.damage.len() < DAMAGE_MAX {
            self.walk.damage.push(sentence);
        } else {
            self.damage_more += 1;
        }
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

    fn entry(&mut self, cluster: u32) -> io::Result<u32> {
        let block = cluster / ENTRIES_PER_BLOCK;
        let first = block - block % WINDOW_BLOCKS;
        if self.window.as_ref().is_none_or(|(start, _)| *start != first) {
            let blocks = WINDOW_BLOCKS.min(self.layout.fat_blocks.saturating_sub(first));
            let mut bytes = vec![0; blocks as usize * BLOCK as usize];
            self.image.read_at(u64::from(self.layout.fat_start + first) * BLOCK, &mut bytes)?;
            self.window = Some((first, bytes));
        }
        let at = (cluster - first * ENTRIES_PER_BLOCK) as usize * 4;
        let bytes = self.window.as_ref().and_then(|(_, bytes)| bytes.get(at..at + 4));
        let raw = bytes.and_then(|bytes| bytes.try_into().ok()).map_or(0, u32::from_le_bytes);
        Ok(raw & ENTRY_MASK)
    }

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

    /// At most `clusters_max`; stops at the first error and reports it.
    fn chain(&mut self, first: u32, clusters_max: u64, what: &Name<'_>) -> io::Result<Chain> {
        let mut chain = Chain::default();
        let mut cluster = first;
        while cluster < END_OF_CHAIN {
            if !self.is_cluster(cluster) {
                self.damaged(format!("{what}: its chain leads to cluster {cluster}, which is none"));
                break;
            }
            if !self.claim(cluster) {
                self.damaged(format!("{what}: cluster {cluster} belongs to something else as well"));
                break;
            }
            if chain.clusters == clusters_max {
                self.damaged(format!("{what}: its chain is longer than its size"));
                break;
            }
            let (start, length) = (self.place(cluster), self.cluster_bytes());
            let held = self.extents + chain.extents.len();
            match chain.extents.last_mut() {
                Some(last) if last.start + last.length == start => last.length += length,
                _ if !what.is_kept() => {}
                _ if held < EXTENTS_MAX => chain.extents.push(Extent { start, length }),
                _ => {
                    self.damaged(format!("{what}: the segments lie in more than {EXTENTS_MAX} pieces"));
                    break;
                }
            }
            chain.clusters += 1;
            cluster = self.entry(cluster)?;
        }
        Ok(chain)
    }

    fn directory(&mut self, first: u32, path: &str, depth: usize) -> io::Result<()> {
        let bytes_max = (ENTRIES_MAX * ENTRY_BYTES) as u64;
        let clusters_max = bytes_max.div_ceil(self.cluster_bytes());
        let chain = self.chain(first, clusters_max, &Name::Directory(path))?;
        for child in self.children(&chain.extents, bytes_max)? {
            self.child(&child, path, depth)?;
        }
        Ok(())
    }

    fn children(&mut self, extents: &[Extent], bytes_max: u64) -> io::Result<Vec<Child>> {
        let mut children = Vec::new();
        let mut bytes = Vec::new();
        let mut left = bytes_max;
        for extent in extents {
            let (mut at, end) = (extent.start, extent.start + extent.length.min(left));
            left -= extent.length.min(left);
            while at < end {
                bytes.resize(READ_BYTES.min(end - at) as usize, 0);
                self.image.read_at(at, &mut bytes)?;
                at += bytes.len() as u64;
                for entry in bytes.chunks_exact(ENTRY_BYTES) {
                    match Entry::read(entry) {
                        Some(Entry::End) => return Ok(children),
                        Some(Entry::Child(child)) => children.push(child),
                        Some(Entry::Deleted(child)) => self.deleted(&child)?,
                        None => {}
                    }
                }
            }
        }
        Ok(children)
    }

    fn deleted(&mut self, child: &Child) -> io::Result<()> {
        let is_segment = child.segment().is_some() && self.is_cluster(child.first);
        if is_segment && self.entry(child.first)? == 0 {
            self.walk.deleted_logs += u64::from(self.begins_as_log(child)?);
        }
        Ok(())
    }

    fn begins_as_log(&self, child: &Child) -> io::Result<bool> {
        let mut block = [0; BLOCK as usize];
        if child.is_directory || u64::from(child.size) < BLOCK || !self.is_cluster(child.first) {
            return Ok(false);
        }
        self.image.read_at(self.place(child.first), &mut block)?;
        Ok(Header::read(&block).is_ok())
    }

    fn child(&mut self, child: &Child, path: &str, depth: usize) -> io::Result<()> {
        let segment = child.segment();
        let is_kept = segment.is_some() || self.begins_as_log(child)?;
        let name = Name::Child { path, child, is_kept };
        if child.is_directory {
            if depth >= DEPTH_MAX {
                self.damaged(format!("{name}: directories deeper than {DEPTH_MAX} are not read"));
                return Ok(());
            }
            return self.directory(child.first, &name.to_string(), depth + 1);
        }
        let size = u64::from(child.size);
        let Chain { mut extents, clusters } = match child.first {
            0 => Chain::default(),
            first => self.chain(first, size.div_ceil(self.cluster_bytes()), &name)?,
        };
        let missing = size.saturating_sub(clusters * self.cluster_bytes());
        if missing > 0 {
            self.damaged(format!("{name}: the last {missing} of its {size} bytes have no cluster"));
        }
        if !is_kept {
            return Ok(());
        }
        if self.walk.files.len() >= FILES_MAX {
            self.files_more += 1;
            return Ok(());
        }
        let mut left = size;
        for extent in &mut extents {
            extent.length = extent.length.min(left);
            left -= extent.length;
        }
        extents.shrink_to_fit();
        self.extents += extents.len();
        self.walk.files.push(CardFile { path: name.to_string(), name: segment, size, extents });
        Ok(())
    }

    fn count_lost(&mut self) -> io::Result<()> {
        for cluster in 2..self.layout.clusters + 2 {
            let used =
                self.used.get(cluster as usize / 64).is_some_and(|word| word & (1 << (cluster % 64)) != 0);
            // 0x0ffffff7 marks a bad cluster.
            if used {
                continue;
            }
            match self.entry(cluster)? {
                0 => self.walk.free_clusters += 1,
                0x0fff_fff7 => {}
                _ => {
                    self.walk.lost_clusters += 1;
                    self.keep_lost(cluster);
                }
            }
        }
        Ok(())
    }

    fn keep_lost(&mut self, cluster: u32) {
        let (start, length) = (self.place(cluster), self.cluster_bytes());
        let held = self.extents + self.walk.lost.len();
        match self.walk.lost.last_mut() {
            Some(last) if last.start + last.length == start => last.length += length,
            _ if held < EXTENTS_MAX => self.walk.lost.push(Extent { start, length }),
            _ => {}
        }
    }
}

#[derive(Default)]
struct Chain {
    /// Joined to runs.
    extents: Vec<Extent>,
    clusters: u64,
}

/// A chain's owner; the name is only put together for a report.
enum Name<'a> {
    Directory(&'a str),
    Child { path: &'a str, child: &'a Child, is_kept: bool },
}

impl Name<'_> {
    fn is_kept(&self) -> bool {
        match self {
            Self::Directory(_) => true,
            Self::Child { is_kept, .. } => *is_kept,
        }
    }
}

impl fmt::Display for Name<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Directory("") => f.write_str("the root directory"),
            Self::Directory(path) => f.write_str(path),
            Self::Child { path: "", child, .. } => f.write_str(&child.name()),
            Self::Child { path, child, .. } => write!(f, "{path}/{}", child.name()),
        }
    }
}

enum Entry {
    End,
    Child(Child),
    Deleted(Child),
}

/// Small: a directory has up to 65,536.
struct Child {
    /// Padded with spaces: eight bytes of base, three of extension.
    short: [u8; 11],
    is_directory: bool,
    first: u32,
    size: u32,
}

impl Entry {
    /// `None` for parts of long names, the volume's label, `.` and `..`.
    fn read(entry: &[u8]) -> Option<Self> {
        let entry: &[u8; ENTRY_BYTES] = entry.try_into().ok()?;
        let attributes = entry[11];
        match entry[0] {
            0 => return Some(Self::End),
            b'.' => return None,
            _ if attributes & ATTRIBUTE_LONG_NAME == ATTRIBUTE_LONG_NAME
                || attributes & ATTRIBUTE_VOLUME != 0 =>
            {
                return None;
            }
            _ => {}
        }
        let is_deleted = entry[0] == DELETED;
        let mut short: [u8; 11] = *entry.first_chunk()?;
        if is_deleted {
            short[0] = b'0';
        }
        let child = Child {
            short,
            is_directory: attributes & ATTRIBUTE_DIRECTORY != 0,
            first: u32::from_le_bytes([entry[26], entry[27], entry[20], entry[21]]) & ENTRY_MASK,
            size: u32::from_le_bytes([entry[28], entry[29], entry[30], entry[31]]),
        };
        Some(if is_deleted { Self::Deleted(child) } else { Self::Child(child) })
    }
}

impl Child {
    /// Base and extension without padding.
    fn parts(&self) -> (&[u8], &[u8]) {
        let (base, extension) = self.short.split_at(8);
        (base.trim_ascii_end(), extension.trim_ascii_end())
    }

    fn segment(&self) -> Option<LogName> {
        let (base, extension) = self.parts();
        LogName::from_short(base, extension)
    }

    fn name(&self) -> String {
        // Safe in a path of this PC.
        let safe = |bytes: &[u8]| -> String {
            let keep = |byte: &u8| byte.is_ascii_alphanumeric() || b"_-~".contains(byte);
            bytes.iter().map(|byte| if keep(byte) { char::from(*byte) } else { '_' }).collect()
        };
        match self.parts() {
            (base, []) => safe(base),
            (base, extension) => format!("{}.{}", safe(base), safe(extension)),
        }
    }
}
