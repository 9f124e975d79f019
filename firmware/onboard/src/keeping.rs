//! What of the record is kept: all of it from power-on, or what is around the times when the vehicle is armed.
//!
//! Recording by arming records all the time too, because only so is there something to keep of the time before arming;
//! but while the vehicle is disarmed storage is told to keep the last while only ([`CardStatus::wait_from`]), and each
//! group of sectors says so, for whoever reads the log and misses the rest.

use hums_blackbox::record::Keep;
use hums_blackbox::{Record, Writer};
use hums_core::params::{Param, Params};
use hums_core::time::{Instant, Span};
use hums_recorder::CardStatus;

use crate::queues::SectorsIn;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    /// Just powered on.
    Fresh,
    /// Everything is kept.
    All,
    /// From this sector on, the last so many seconds. A change of `REC_BEFORE` counts from the next disarming on: what was
    /// dropped is not there any more.
    Last { from: u32, seconds: u32 },
}

/// Decides what is kept.
#[derive(Debug)]
pub(crate) struct Keeping {
    state: State,
    /// When the vehicle was armed last.
    armed_at: Option<Instant>,
    /// What the record does not say yet.
    due: Option<Keep>,
    /// The group that says that only the last while is kept.
    group: u64,
    /// Files that storage has begun.
    files: u32,
}

impl Keeping {
    pub(crate) const fn new() -> Self {
        Self { state: State::Fresh, armed_at: None, due: None, group: 0, files: 0 }
    }

    /// Every tick, and once before the first record. `write` gives access to writer and queue.
    pub(crate) fn tick(
        &mut self,
        now: Instant,
        params: &Params,
        armed: bool,
        card: &CardStatus,
        writer: &mut Writer,
        sectors: &mut SectorsIn<'_>,
    ) {
        if armed {
            self.armed_at = Some(now);
        }
        let span = |param| Span::from_millis((params.get(param) * 1000.0) as u64);
        let by_arming = params.get(Param::RecMode) > 0.5;
        let lately = self.armed_at.is_some_and(|at| armed || now.since(at) < span(Param::RecAfter));
        let (before, all) = (span(Param::RecBefore), !by_arming || lately);
        match self.state {
            State::Fresh | State::All if all => self.state = State::All,
            State::Fresh | State::All if self.due.is_none() => {
                // The file ends here in order; what comes begins another one, and says first what it is.
                let is_fresh = self.state == State::Fresh;
                if is_fresh || sectors.with_reserve(|sink| writer.finish(sink)) {
                    let from = writer.counters().sectors as u32;
                    let seconds = (before.as_millis() / 1000) as u32;
                    card.wait_from(from, before);
                    self.state = State::Last { from, seconds };
                    self.due = Some(Keep { all: false, from, seconds });
                }
            }
            // Storage has ended the wait itself where a group goes on in a further file, because the card was out or refused: then the log
            // ends here, as after an arming.
            State::Last { from, seconds } if all || !card.is_waiting() => {
                card.keep_all();
                self.state = State::All;
                self.due = Some(Keep { all: true, from, seconds });
            }
            State::Last { from, seconds } if writer.counters().groups != self.group => {
                self.due = Some(Keep { all: false, from, seconds });
            }
            _ => {}
        }
        if let Some(due) = self.due
            && sectors.with_reserve(|sink| writer.record(now, &Record::Keep(due), sink)).is_ok()
        {
            self.due = None;
            self.group = writer.counters().groups;
        }
    }

    /// Whether storage has begun a file since the last call, other than the first one.
    pub(crate) fn takes_new_file(&mut self, card: &CardStatus) -> bool {
        let before = core::mem::replace(&mut self.files, card.read().segments);
        before != 0 && before != self.files
    }
}

#[cfg(test)]
mod tests {
    use hums_blackbox::{Entry, GroupDecoder, Header};

    use super::*;
    use crate::queues::Queues;

    /// What is done before a tick.
    type Act<'a> = &'a dyn Fn(&CardStatus, &mut Params);

    /// What the record says is kept, of a vehicle that is armed or not at each tick, with what is done before it; and how many of its
    /// sectors end a log.
    fn said(ticks: &[(bool, Act<'_>)]) -> (Vec<Keep>, usize) {
        let (mut queues, mut writer) = (Box::new(Queues::new()), Box::new(Writer::new()));
        let mut ends = queues.split();
        let (card, mut params, mut keeping) = (CardStatus::new(), Params::defaults(), Keeping::new());
        params.set("REC_MODE", 1.0).expect("a parameter");
        for (tick, (armed, act)) in (0..).zip(ticks) {
            act(&card, &mut params);
            let now = Instant::from_millis(tick * 50);
            keeping.tick(now, &params, *armed, &card, &mut writer, &mut ends.sectors_in);
        }
        assert!(ends.sectors_in.with_reserve(|sink| writer.restart(sink)));
        let (mut decoder, mut said, mut closed) = (Box::new(GroupDecoder::new()), Vec::new(), 0);
        while let Some(sector) = ends.sectors_out.oldest() {
            let mut sector = *sector;
            sector.seal(1);
            let header = Header::read(sector.bytes()).expect("a sector");
            closed += usize::from(header.closed);
            decoder.push(&header, &sector).expect("in order");
            while let Some(Ok(Entry::Record { record: Record::Keep(keep), .. })) = decoder.next_entry() {
                said.push(keep);
            }
            ends.sectors_out.drop_oldest();
        }
        (said, closed)
    }

    #[test]
    fn the_record_says_what_storage_was_told_also_where_the_parameter_was_changed_meanwhile() {
        let before = |seconds| {
            move |_: &CardStatus, params: &mut Params| {
                params.set("REC_BEFORE", seconds).expect("a parameter");
            }
        };
        let (said, _) = said(&[(false, &before(15.0)), (false, &before(60.0)), (true, &before(60.0))]);
        let said: Vec<_> = said.iter().map(|keep| (keep.all, keep.seconds)).collect();
        assert_eq!(said, [(false, 15), (true, 15)]);
    }

    /// The card was out in the middle of a group, and all that it has of the wait stays: what follows is a log of its own, which says
    /// with which sector it begins.
    #[test]
    fn a_wait_that_storage_has_ended_begins_anew_behind_the_end_of_the_log() {
        let (said, closed) =
            said(&[(false, &|_, _| {}), (false, &|card, _| card.keep_all()), (false, &|_, _| {})]);
        let keep = |all, from| Keep { all, from, seconds: 30 };
        assert_eq!(said, [keep(false, 0), keep(true, 0), keep(false, 1)]);
        assert_eq!(closed, 1);
    }
}
