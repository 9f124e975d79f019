//! The SD card: an image file of the host, block by block through semihosting.

use core::cell::RefCell;
use core::fmt;

use embedded_sdmmc::{Block, BlockCount, BlockDevice, BlockIdx};
use hums_onboard::Task;
use hums_recorder::{CardDevice, Trouble};
use semihosting::fs::File;
use semihosting::io::{Read, Seek, SeekFrom, Write};

/// Semihosting seeks are 31 bits wide here: 2 GiB of the image can be reached.
const BLOCKS_MAX: u64 = (1 << 31) / Block::LEN as u64;

/// The image as a card. No image, or one that cannot be written, is a slot without a card.
pub(crate) struct ImageCard {
    image: RefCell<Option<File>>,
}

/// Why the image could not be read or written.
#[derive(Clone, Copy, Debug)]
pub(crate) enum CardError {
    /// There is no image: no card in the slot.
    NoCard,
    /// The host refused, or the block is past the end of the image.
    Io,
}

impl fmt::Display for CardError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NoCard => "there is no card in the slot",
            Self::Io => "the host refused to read or write the image",
        })
    }
}

impl core::error::Error for CardError {}

impl ImageCard {
    pub(crate) fn new(image: Option<File>) -> Self {
        Self { image: RefCell::new(image) }
    }

    fn at<T>(
        &self,
        index: BlockIdx,
        act: impl FnOnce(&mut File) -> Result<T, CardError>,
    ) -> Result<T, CardError> {
        let mut image = self.image.try_borrow_mut().map_err(|_| CardError::Io)?;
        let file = image.as_mut().ok_or(CardError::NoCard)?;
        if u64::from(index.0) >= BLOCKS_MAX {
            return Err(CardError::Io);
        }
        let position = u64::from(index.0) * Block::LEN as u64;
        file.seek(SeekFrom::Start(position)).map_err(|_| CardError::Io)?;
        act(file)
    }
}

impl BlockDevice for ImageCard {
    type Error = CardError;

    fn read(&self, blocks: &mut [Block], start: BlockIdx) -> Result<(), CardError> {
        self.at(start, |file| {
            for block in blocks.iter_mut() {
                read_block(file, &mut block.contents)?;
            }
            Ok(())
        })
    }

    fn write(&self, blocks: &[Block], start: BlockIdx) -> Result<(), CardError> {
        let _ = super::provoke::here(Task::Storage);
        self.at(start, |file| {
            blocks.iter().try_for_each(|block| file.write_all(&block.contents).map_err(|_| CardError::Io))
        })
    }

    fn num_blocks(&self) -> Result<BlockCount, CardError> {
        let image = self.image.try_borrow().map_err(|_| CardError::Io)?;
        let file = image.as_ref().ok_or(CardError::NoCard)?;
        let bytes = file.metadata().map_err(|_| CardError::Io)?.len();
        Ok(BlockCount((bytes / Block::LEN as u64).min(BLOCKS_MAX) as u32))
    }
}

impl CardDevice for ImageCard {
    fn trouble(error: &CardError) -> Trouble {
        match error {
            CardError::NoCard => Trouble::Gone,
            CardError::Io => Trouble::Refusing,
        }
    }
}

fn read_block(file: &mut File, mut rest: &mut [u8]) -> Result<(), CardError> {
    while !rest.is_empty() {
        match file.read(rest) {
            Ok(0) | Err(_) => return Err(CardError::Io),
            Ok(count) => rest = rest.get_mut(count..).ok_or(CardError::Io)?,
        }
    }
    Ok(())
}
