//! A card's file and a copy of its partition for `fsck.vfat`.

use std::fs::File;
use std::io::{Read as _, Seek as _, SeekFrom, Write as _};
use std::os::unix::fs::FileExt as _;
use std::path::PathBuf;

use anyhow::{Context as _, Result, anyhow, ensure};
use hums::card::image::{ReadOnlyImage, open_or_make};
use hums::card::{Faults, SimCard};
use hums::logs::fat::{Extent, Volume, Walk};
use hums::run::sim::PowerOn;
use hums::run::sim::both_ports::power_on;
use hums_recorder::layout::Layout;
use tempfile::TempDir;

use super::stream::Stream;
use crate::fat;

pub(super) const BLOCK: usize = 512;

pub(super) fn blocks_of(extents: &[Extent]) -> impl Iterator<Item = u32> + '_ {
    extents.iter().flat_map(|extent| {
        let first = (extent.start / BLOCK as u64) as u32;
        first..first + extent.length.div_ceil(BLOCK as u64) as u32
    })
}

pub(super) struct Card {
    dir: TempDir,
    file: File,
    /// Made on first use, then kept up to date.
    partition: Option<(File, u64)>,
}

impl Card {
    pub(super) fn new(mib: u64) -> Result<Self> {
        let dir = tempfile::tempdir()?;
        let file = open_or_make(&dir.path().join("card.img"), Some(mib), |_| Ok(()))?;
        let device = SimCard::new(file.try_clone()?, Faults::default())?;
        hums_recorder::format::format(&device, 0x4855_4d53).map_err(|error| anyhow!("format: {error:?}"))?;
        Ok(Self { dir, file, partition: None })
    }

    pub(super) fn path(&self) -> PathBuf {
        self.dir.path().join("card.img")
    }

    pub(super) fn device(&self, faults: Faults) -> Result<SimCard> {
        Ok(SimCard::new(self.file.try_clone()?, faults)?)
    }

    pub(super) fn record(&self, stream: &Stream, boots: u32) -> Result<PowerOn> {
        let device = self.device(Faults::default())?;
        power_on(&device, boots, stream.chunks())
    }

    pub(super) fn content(&self) -> Result<Vec<u8>> {
        let mut bytes = Vec::new();
        let mut file = self.file.try_clone()?;
        file.seek(SeekFrom::Start(0))?;
        file.read_to_end(&mut bytes)?;
        Ok(bytes)
    }

    pub(super) fn read_block(&self, block: u32) -> Result<[u8; BLOCK]> {
        let mut bytes = [0; BLOCK];
        self.file.read_exact_at(&mut bytes, u64::from(block) * BLOCK as u64)?;
        Ok(bytes)
    }

    pub(super) fn write_block(&self, block: u32, bytes: &[u8; BLOCK]) -> Result<()> {
        let at = u64::from(block) * BLOCK as u64;
        self.file.write_all_at(bytes, at)?;
        if let Some((partition, start)) = &self.partition
            && let Some(at) = at.checked_sub(*start)
        {
            partition.write_all_at(bytes, at)?;
        }
        Ok(())
    }

    pub(super) fn walk(&self) -> Result<Walk> {
        let device = ReadOnlyImage::new(self.file.try_clone()?)?;
        let layout = Layout::read(&device).map_err(|error| anyhow!("{error}"))?;
        Volume::new(&self.file, layout)?.walk().context("the file system cannot be walked")
    }

    /// `fsck.vfat -n` finds only effects of a cut.
    pub(super) fn check(&mut self) -> Result<()> {
        let path = self.dir.path().join("partition");
        if self.partition.is_none() {
            let start = fat::extract(&self.path(), &path);
            self.partition = Some((File::options().write(true).open(&path)?, start));
        }
        if let Some((partition, _)) = &mut self.partition {
            partition.flush()?;
        }
        let complaints = fat::complaints(&path);
        ensure!(complaints.is_empty(), "fsck.vfat says: {complaints:#?}");
        Ok(())
    }
}
