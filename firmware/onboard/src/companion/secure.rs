//! Authorisation: signatures of requests, keys, and the items of both that outlive power.
//!
//! With a key, `GS_SIGN` and `AP_SIGN` set the guard of a port:
//!
//! The USB port has the guard of the radio's.
//!
//! - 0: none.
//! - 1: our frames are signed, and a signature must be right.
//! - 2: unsigned requests are refused as well.
//!
//! A refused setting is answered with the old value, a refused command with "denied", other requests not at all.
//!
//! # Source of a key
//!
//! A key comes with `SETUP_SIGNING`, over the port that `SIGN_PORT` trusts: none, unless the card's `PARAMS.TXT` sets
//! one. The autopilot's port is not trusted by default, because ArduPilot routes that message like any other one to
//! us, also from its own radio.
//!
//! `SIGN_PORT` is changed over the trusted port, with a signature, or by the card. With a key, the same holds for the
//! other two parameters.
//!
//! # Secrecy of a key
//!
//! A key is in no parameter and in no message of ours. A `SETUP_SIGNING` at the autopilot's port, to any address, is
//! the one frame that is not recorded, as the signing guide demands of logs. An event records its arrival. It is not
//! passed on.

use embedded_storage::nor_flash::NorFlash;
use hums_core::Monitor;
use hums_core::clock::{Instant, Span};
use hums_core::lifetime::Room;
use hums_core::parameters::{Param, Params};
use hums_link::frame::Frame;
use hums_link::request::Port;
use hums_link::signing::{KEY_BYTES, Key, Seal, Signing, Times, Verdict, stamp};
use hums_store::Key as Item;

use super::ways::Outlets;
use crate::persist::store_writer::SIGNED_MAX;
use crate::persist::{Handover, StoreWriter};
use crate::queues::SummaryRoute;

/// Numbers of stored items: the key, and [`Times`] as three `u64`.
const ITEM_KEY: u8 = 32;
const ITEM_TIMES: u8 = 33;
const TIMES_BYTES: usize = 24;
const SAVE: Span = Span::from_secs(1);
/// The same while the store has little more than its reserve, and then [`SIGNED_MAX`] times at most.
const SAVE_SCARCE: Span = Span::from_secs(60);
/// Link ids by the port's number: summary stream and answers at the radio's port, frames to the autopilot, USB.
const LINKS: [u8; Port::ALL.len()] = [0, 1, 2];

/// 0 to 2.
fn guard(params: &Params, port: Port) -> u8 {
    params.get(match port {
        Port::Gs | Port::Usb => Param::GsSign,
        Port::Autopilot => Param::ApSign,
    }) as u8
}

pub(crate) fn is_trusted(params: &Params, port: Port) -> bool {
    let number = match port {
        Port::Gs | Port::Usb => 1,
        Port::Autopilot => 2,
    };
    params.get(Param::SignPort) as u8 == number
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Trust {
    Open,
    Signed,
    Refused,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct RequestSigning {
    signing: Signing,
    times: Times,
    key_due: bool,
    times_due: bool,
    saved_at: Option<Instant>,
    /// Times stored since the store had more than its reserve.
    scarce: u8,
    last: u64,
    /// A key was set together with the time: all outlets begin anew.
    reseal: bool,
    pub(super) refused: u32,
}

impl RequestSigning {
    pub(crate) const fn new() -> Self {
        Self {
            signing: Signing::new(),
            times: Times { accepted: 0, used: 0, time: 0 },
            key_due: false,
            times_due: false,
            saved_at: None,
            scarce: 0,
            last: 0,
            reseal: false,
            refused: 0,
        }
    }

    /// At power-on, before the first frame is sent.
    pub(crate) fn restore<F: NorFlash>(&mut self, store_writer: &mut StoreWriter<'_, F>) {
        let mut bytes = [0; KEY_BYTES];
        let key = (store_writer.item(ITEM_KEY, &mut bytes) == KEY_BYTES).then_some(Key(bytes));
        let mut bytes = [0; TIMES_BYTES];
        let len = store_writer.item(ITEM_TIMES, &mut bytes);
        if let ([accepted, used, time], []) = bytes.as_chunks::<8>()
            && len == TIMES_BYTES
        {
            let number = |bytes: &[u8; 8]| u64::from_le_bytes(*bytes);
            self.times = Times { accepted: number(accepted), used: number(used), time: number(time) };
            self.last = self.times.used;
        }
        self.signing.restore(key, self.times);
    }

    /// At every tick and at the end; whether no item is left. `last` is the highest stamp of our signatures.
    pub(crate) fn save(&mut self, now: Instant, last: Option<u64>, handover: &mut Handover<'_>) -> bool {
        let Self { signing, times, key_due, times_due, saved_at, scarce, .. } = self;
        let has_room = handover.room() == Room::Enough;
        *scarce = if has_room { 0 } else { *scarce };
        let every = if has_room { SAVE } else { SAVE_SCARCE };
        if *key_due {
            let bytes = signing.key().map_or([0; KEY_BYTES], |key| key.0);
            *key_due = !handover.put(Item::item(ITEM_KEY), &bytes);
        }
        // Periodic saves leave the reserve for landing. After a power-off stamps may then begin below the last one,
        // and are refused until UTC is known.
        if let Some(last) = last.filter(|_| has_room) {
            *times_due |= times.keep_ahead(now, signing.clock.now(now), last);
        }
        let may = *scarce < SIGNED_MAX && saved_at.is_none_or(|at| now.since(at) >= every);
        if *times_due && may {
            let mut bytes = [0; TIMES_BYTES];
            let numbers = [times.accepted, times.used, times.time];
            for (bytes, number) in bytes.as_chunks_mut::<8>().0.iter_mut().zip(numbers) {
                *bytes = number.to_le_bytes();
            }
            if handover.put(Item::item(ITEM_TIMES), &bytes) {
                (*times_due, *saved_at) = (false, Some(now));
                *scarce += u8::from(!has_room);
            }
        }
        !*key_due && !*times_due
    }

    pub(crate) fn trust(&mut self, now: Instant, params: &Params, port: Port, frame: &Frame<'_>) -> Trust {
        let guard = guard(params, port);
        if guard == 0 || self.signing.key().is_none() {
            return Trust::Open;
        }
        match self.signing.judge(now, frame) {
            Verdict::Good => Trust::Signed,
            Verdict::Unsigned if guard == 1 => Trust::Open,
            Verdict::Unsigned | Verdict::Wrong | Verdict::Replayed => {
                self.refused = self.refused.saturating_add(1);
                Trust::Refused
            }
        }
    }

    /// Notes a change. After a change by a signed frame, no older frame is accepted any more.
    pub(crate) fn changed(&mut self, trust: Trust) {
        if trust == Trust::Signed {
            self.times.accepted = self.signing.latest();
            self.times_due = true;
        }
    }

    /// Whether a request with this authorisation may set a parameter. [`Logbook`](crate::journal::Logbook) decides
    /// whether it may be set now.
    pub(crate) fn may_set(&self, monitor: &Monitor, port: Port, param: Param, trust: Trust) -> bool {
        let guards = match param {
            Param::SignPort => true,
            Param::GsSign | Param::ApSign => self.signing.key().is_some(),
            _ => false,
        };
        match trust {
            Trust::Refused => false,
            Trust::Signed => true,
            Trust::Open => !guards || is_trusted(monitor.params(), port),
        }
    }

    pub(crate) fn set_key(&mut self, now: Instant, key: Key, stamp: u64) {
        if stamp > 0 || self.signing.key() != Some(&key) {
            (self.last, self.reseal) = (0, true);
        }
        self.signing.set(now, key, stamp);
        self.times =
            Times { accepted: self.signing.latest(), used: self.last, time: self.signing.clock.now(now) };
        (self.key_due, self.times_due) = (true, true);
    }

    /// Keeps all outlets signing by the settings, in our time.
    pub(crate) fn seal(&mut self, now: Instant, monitor: &Monitor, ways: &mut Outlets) {
        let params = monitor.params();
        let carries = if ways.queues.route() == SummaryRoute::Autopilot { Port::Autopilot } else { Port::Gs };
        let guards = [carries, Port::Autopilot, Port::Usb].map(|port| guard(params, port));
        let Self { signing, last, reseal, .. } = self;
        let reseal = core::mem::take(reseal);
        let time = &monitor.vehicle().time;
        if let (Some(at), Some(utc_micros)) = (time.at(), time.get().and_then(|time| time.utc_micros)) {
            signing.clock.hear_utc(Instant::of(at, now), stamp(utc_micros));
        }
        for ((outlet, link), guard) in ways.all().into_iter().zip(LINKS).zip(guards) {
            match (signing.key().filter(|_| guard > 0), &mut outlet.seal) {
                (Some(key), Some(seal)) if seal.is_of(key) && !reseal => seal.clock = signing.clock,
                (Some(key), seal) => *seal = Some(Seal::new(*key, link, signing.clock, *last)),
                // A new seal continues its stamps.
                (None, seal) => *last = seal.take().map_or(*last, |seal| seal.last().max(*last)),
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::persist::{Mailbox, SaveStep, StoreStatus};
    use hums_core::lifetime::ItemKey;
    use hums_store::sim::SimFlash;

    type Flash = SimFlash<16384>;

    #[test]
    fn a_key_is_left_until_it_and_its_times_are_in_the_mailbox() {
        let mut flash = Flash::blank();
        let (mut mailbox, status) = (Mailbox::new(), StoreStatus::default());
        let (items_in, items_out) = mailbox.split();
        let mut store_writer = StoreWriter::mount(&mut flash, items_out, &status);
        let mut monitor = Box::new(Monitor::new(Params::defaults()));
        let mut handover = Handover::new(items_in, &status, &mut monitor);
        let mut secure = RequestSigning::new();
        assert!(secure.save(Instant::ZERO, None, &mut handover), "there is no key");
        secure.set_key(Instant::ZERO, Key([7; KEY_BYTES]), 1);
        let all = [0; 3].map(|_| {
            let all = secure.save(Instant::ZERO, None, &mut handover);
            assert!(!handover.finish(Instant::ZERO, &mut monitor), "the last item is not written");
            store_writer.service(true);
            all
        });
        assert_eq!(all, [false, true, true]);
        assert_ne!(store_writer.item(ITEM_TIMES, &mut [0; TIMES_BYTES]), 0);
    }

    #[test]
    fn signed_changes_all_day_leave_what_a_landing_needs_of_the_store() {
        let mut flash = Flash::blank();
        let (mut mailbox, status) = (Mailbox::new(), StoreStatus::default());
        let (items_in, items_out) = mailbox.split();
        let mut store_writer = StoreWriter::mount(&mut flash, items_out, &status);
        let mut monitor = Box::new(Monitor::new(Params::defaults()));
        let mut handover = Handover::new(items_in, &status, &mut monitor);
        let mut secure = RequestSigning::new();
        secure.set_key(Instant::ZERO, Key([7; KEY_BYTES]), 1);
        let mut scarce = 0;
        for second in 1..86_400 {
            secure.changed(Trust::Signed);
            secure.times.time = second;
            secure.save(Instant::from_millis(second * 1_000), None, &mut handover);
            while store_writer.service(false) == SaveStep::Took {
                scarce += u32::from(handover.room() == Room::Reserve);
            }
        }
        assert!((1..=u32::from(SIGNED_MAX) + 1).contains(&scarce), "{scarce}");
        let landing = [(ItemKey::Exceedances, 505), (ItemKey::Session, 160), (ItemKey::Session, 160)];
        for (key, length) in landing {
            assert!(handover.put(Item::item(key.number()), &[1; 512][..length]));
            assert_eq!(store_writer.service(false), SaveStep::Took, "{key:?}");
        }
        assert_eq!(status.read().refused, 0);
        assert!(secure.times_due);
        assert!(store_writer.turn_ahead());
        secure.save(Instant::from_millis(86_400_000), None, &mut handover);
        assert!(!secure.times_due && store_writer.service(false) == SaveStep::Took);
    }
}
