//! DMA at work: requests at once, copies when their time is over.

use crate::access::DmaPort;
use crate::chip::Chip;
use crate::dma::{Request, request};
use crate::map::Unit;
use crate::time::NEVER;

impl Chip {
    fn asks(&self, request: Request) -> bool {
        match request {
            Request::UsartRx(number) => self.usarts[number as usize].wants_fetch(),
            Request::UsartTx(number) => self.usarts[number as usize].wants_byte(),
            Request::SpiRx(number) => self.spis[number as usize].wants_fetch(),
            Request::SpiTx(number) => self.spis[number as usize].wants_word(),
        }
    }

    /// All requests.
    pub(crate) fn pump(&mut self) {
        while let Some((dma, stream)) = self.asking() {
            let mut served = self.dmas[dma].streams[stream];
            served.serve(&mut DmaPort { chip: self, controller: dma });
            self.dmas[dma].streams[stream] = served;
            self.dmas[dma].note(stream);
            self.look_at(Unit::Dma(dma as u8), self.moment);
        }
    }

    fn asking(&self) -> Option<(usize, usize)> {
        for (dma, controller) in self.dmas.iter().enumerate() {
            let mut on = controller.on;
            while on != 0 {
                let stream = on.trailing_zeros() as usize;
                on &= on - 1;
                let channel = controller.streams[stream].channel();
                if request(dma, stream, channel).is_some_and(|request| self.asks(request)) {
                    return Some((dma, stream));
                }
            }
        }
        None
    }

    pub(crate) fn copying(&self, dma: usize) -> Option<usize> {
        (0..8).find(|stream| self.dmas[dma].on >> stream & 1 == 1 && self.dmas[dma].streams[*stream].copies())
    }

    pub(crate) fn copy(&mut self, dma: usize) {
        self.copies[dma] = NEVER;
        let Some(stream) = self.copying(dma) else { return };
        let mut served = self.dmas[dma].streams[stream];
        while served.is_on() {
            served.serve(&mut DmaPort { chip: self, controller: dma });
        }
        self.dmas[dma].streams[stream] = served;
        self.dmas[dma].note(stream);
    }
}
