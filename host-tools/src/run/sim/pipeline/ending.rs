//! A power-on's end and result.

use anyhow::Result;
use hums_blackbox::record::Stats;
use hums_core::clock::Span;
use hums_core::parameters::Params;
use hums_recorder::CardState;

use super::Pipeline;

const CARD_PATIENCE: Span = Span::from_secs(5);

impl Pipeline<'_, '_> {
    /// Writes the record out. Returns frames without a card.
    pub(in crate::run::sim) fn finish(&mut self) -> Result<u64> {
        self.reception.idle(self.now, &mut self.ends.frames_in);
        self.drain()?;
        self.save_all();
        self.monitoring.finish(self.now);
        let patience = self.now + CARD_PATIENCE;
        while !self.ends.sectors_out.is_empty() && !self.is_dead() {
            let at = self.storage_at.unwrap_or(self.now).max(self.now);
            if at > patience && self.slot_is_empty() {
                break;
            }
            self.now = at;
            self.storage();
        }
        self.now = self.now.max(self.busy_until);
        self.recorder.finish();
        self.now = self.now.max(self.gs_at);
        for _ in 0..1000 {
            self.send_gs()?;
            self.now = self.now.max(self.gs_at);
        }
        Ok(self.ends.sectors_out.abandon())
    }

    /// Saves as fast as the store takes it.
    fn save_all(&mut self) {
        self.monitoring.save_signing(self.now, &mut self.handover);
        while !self.handover.finish(self.now, self.monitoring.monitor_mut()) && !self.is_dead() {
            self.keep(true);
        }
        self.keep(true);
        self.note();
    }

    fn slot_is_empty(&self) -> bool {
        self.slot_status.read().state != CardState::Recording
    }

    pub(in crate::run::sim) fn stats(&self) -> Stats {
        self.monitoring.stats()
    }

    pub(in crate::run::sim) fn params(&self) -> Params {
        *self.monitoring.monitor().params()
    }

    pub(in crate::run::sim) fn is_full(&self) -> bool {
        self.slot_status.read().state == CardState::Full
    }

    pub(in crate::run::sim) fn has_overwritten(&self) -> bool {
        self.slot_status.read().segments_overwritten > 0
    }
}
