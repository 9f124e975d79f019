//! The microSD card on an SPI bus.

use core::cell::Cell;

use embassy_stm32::gpio::Output;
use embassy_stm32::mode::Blocking;
use embassy_stm32::spi::{Spi, mode::Master};
use embassy_stm32::time::Hertz;
use embassy_time::Delay;
use embedded_hal_bus::spi::{ExclusiveDevice, NoDelay};
use embedded_sdmmc::{Block, BlockCount, BlockDevice, BlockIdx, SdCard, SdCardError};
use hums_recorder::CardDevice;

type CardSpi = ExclusiveDevice<Spi<'static, Blocking, Master>, Output<'static>, NoDelay>;

/// The microSD card. Its driver waits for the card with the processor: only the least urgent task may use it.
pub(crate) struct Card {
    driver: SdCard<CardSpi, Delay>,
    /// Whether the card is identified, so that the fast clock may be used.
    identified: Cell<bool>,
}

impl Card {
    /// What a card must be able to take before it is identified (SD specification, 4.2.1).
    pub(crate) const IDENTIFICATION: Hertz = Hertz(400_000);
    /// What every card takes afterwards: default speed is 25 MHz at most, the next slower clock of these chips is 21.
    const TRANSFER: Hertz = Hertz(21_000_000);

    /// On this bus, at [`Self::IDENTIFICATION`], selected by this pin.
    pub(crate) fn new(bus: Spi<'static, Blocking, Master>, select: Output<'static>) -> Self {
        let Ok(spi) = ExclusiveDevice::new_no_delay(bus, select);
        Self { driver: SdCard::new(spi, Delay), identified: Cell::new(false) }
    }

    fn set_clock(&self, frequency: Hertz) {
        self.driver.spi(|device| {
            let mut config = device.bus().get_current_config();
            config.frequency = frequency;
            // Cannot fail: both clocks are within what the bus can divide down to.
            let _ = device.bus_mut().set_config(&config);
        });
    }

    /// Identifies the card at the slow clock if that is still to be done.
    fn ready(&self) -> Result<(), SdCardError> {
        if self.identified.get() {
            return Ok(());
        }
        self.set_clock(Self::IDENTIFICATION);
        // At least 74 clocks with the card not selected wake it up (SD specification, 6.4.1).
        self.driver
            .spi(|device| device.bus_mut().blocking_write(&[0xFF_u8; 10]))
            .map_err(|_| SdCardError::Transport)?;
        self.driver.num_bytes()?;
        self.set_clock(Self::TRANSFER);
        self.identified.set(true);
        Ok(())
    }
}

impl BlockDevice for Card {
    type Error = SdCardError;

    fn read(&self, blocks: &mut [Block], start: BlockIdx) -> Result<(), SdCardError> {
        self.ready()?;
        self.driver.read(blocks, start)
    }

    fn write(&self, blocks: &[Block], start: BlockIdx) -> Result<(), SdCardError> {
        self.ready()?;
        self.driver.write(blocks, start)
    }

    fn num_blocks(&self) -> Result<BlockCount, SdCardError> {
        self.ready()?;
        self.driver.num_blocks()
    }
}

impl CardDevice for Card {
    fn reset(&self) {
        self.driver.mark_card_uninit();
        self.identified.set(false);
    }
}
