//! Logs one after the other, each with what a later one says of its end.
//!
//! The recorder notes at each start where the session before ended on that card. A log is therefore held back until the
//! next ones were read: a file that was made when the power went has no sector, and says nothing.

use std::collections::{BTreeMap, VecDeque};

use hums_blackbox::GROUP_SECTORS;
use hums_blackbox::record::{Before, Found};
use hums_core::clock::{Instant, Span};

use crate::ending::{Ending, Misnamed, PowerOn, Proof, SessionBefore, Teller};
use crate::logs::begun_anew::LOOKED_AT_MAX;
use crate::logs::sessions::{Sessions, place};

/// Logs held back at most; so many after a log may say something of its end.
pub const HELD_MAX: usize = 4;

/// Files of a log by arming that share its number; the next one has the next number, and the first of it `_00`.
const FILES_A_NUMBER: u64 = 100;
/// A vehicle that waits for its arming fills a file, of so many sectors at least, or leaves it after this time.
const FILE_SECTORS_MIN: u64 = 2 * GROUP_SECTORS as u64;
const FILE_AGE_MIN: Span = Span::from_secs(5);

/// What is made of a log that was read.
pub trait Logged {
    /// What is known of its end, where it is a log of ours.
    fn ending(&mut self) -> Option<&mut Ending>;

    /// The log before it of the same power-on, whose end was read, has so many sectors and frames of that: what is missing before this
    /// one is counted from there on.
    fn follows(&mut self, _sectors: u32, _frames: Option<u32>) {}
}

/// Holds logs back for as long as a later one may say something of their end.
#[derive(Debug)]
pub struct Followed<T> {
    held: VecDeque<T>,
    sessions: Sessions,
    /// The latest log of each power-on, by card and session.
    latest: BTreeMap<(String, u32), Latest>,
}

/// A log of a power-on that may have more of them.
#[derive(Clone, Copy, Debug)]
struct Latest {
    number: u32,
    /// The number of its last whole sector and one.
    end: u32,
    /// Frames of the power-on up to its end, modulo 2^32.
    frames_end: Option<u32>,
    /// The check of its entries, where it ends with a whole sector.
    check_end: Option<u32>,
    last: Option<Instant>,
}

impl<T: Logged> Followed<T> {
    /// Of logs whose first sectors were looked at.
    pub const fn new(sessions: Sessions) -> Self {
        Self { held: VecDeque::new(), sessions, latest: BTreeMap::new() }
    }

    /// Takes the next log; gives those of which nothing more will be said, in order.
    pub fn push(&mut self, mut next: T) -> Vec<T> {
        let (mut has_sectors, mut earlier) = (false, None);
        if let Some(ending) = next.ending() {
            has_sectors = ending.summary.session.is_some();
            ending.again = self.sessions.again(&ending.name).map(str::to_owned);
            ending.beginning = self.sessions.beginning(&ending.name).cloned();
            ending.begun_anew = self.sessions.begun_anew(&ending.name);
            // That what a file held before has not its number is told there.
            let is_told = |misnamed: &Misnamed| {
                ending.begun_anew.is_none() || matches!(misnamed, Misnamed::Copy { .. })
            };
            ending.misnamed = self.misnamed(ending).filter(is_told);
            // What was cut off is at its end.
            let is_own = ending.is_counted() || ending.beginning.is_some() && ending.copy_of().is_none();
            let has_place = is_own && ending.begun_anew.is_none();
            if let Some(before) = ending.summary.marks.before
                && has_place
            {
                if before.has_end() {
                    self.tell(&before, ending);
                } else if before.found == Found::Unreadable {
                    self.tell_empty(before.number, &ending.name);
                }
            }
            if has_place {
                earlier = self.follow(ending);
            }
        }
        if let Some(earlier) = earlier {
            next.follows(earlier.end, earlier.frames_end);
        }
        self.held.push_back(next);
        // Only the newest that has sectors can be what the next start found.
        let keep = if has_sectors { 1 } else { HELD_MAX };
        let done = self.held.len().saturating_sub(keep);
        self.held.drain(..done).collect()
    }

    /// There are no more logs.
    pub fn finish(self) -> impl Iterator<Item = T> {
        self.held.into_iter()
    }

    /// What of a log's name disagrees with what the logs hold.
    fn misnamed(&self, ending: &Ending) -> Option<Misnamed> {
        let session = ending.summary.session?;
        if let Some(of) = self.sessions.copy_of(&ending.name, session) {
            return Some(Misnamed::Copy { of });
        }
        let board = ending.summary.marks.board;
        let named = |file: &String| Misnamed::of_name(file, session, board);
        if let Some(misnamed) = ending.files.iter().find_map(named) {
            return Some(misnamed);
        }
        let (card, number) = place(&ending.name);
        let number = number?;
        if ending.summary.marks.packed && self.sessions.has_other(card, 0, u32::MAX, session) {
            return Some(Misnamed::Packed);
        }
        let before = ending.summary.marks.before?;
        // Of a power-on's first log all is there, or what is not was not to be kept.
        let is_whole = ending.summary.first_number == Some(0);
        let is_first = is_whole || ending.summary.keep.is_some_and(|keep| keep.from == 0);
        let waited = numbers_waited(ending, 0, Instant::ZERO);
        let is_next = (1..=waited.saturating_add(1)).contains(&number);
        // A log that begins later came with its vehicle from another card, and may have lost what it found on this one.
        let is_here = is_whole || !self.sessions.has_older(card, number);
        if before.found == Found::Nothing && is_first && !is_next && is_here {
            return Some(Misnamed::First);
        }
        if !before.has_end() || before.session == session {
            return None;
        }
        if number <= before.number {
            return Some(Misnamed::Later { before: before.number });
        }
        // The recorder gives a power-on's first log the next number. A number that no file has any more is of a log that was
        // older than this one, and then the one before is not there either.
        let is_there = self.sessions.numbers(card, before.session).contains(&before.number);
        let is_absent = is_first && is_there && self.sessions.absent(card, before.number, number) > waited;
        // The start would have found what was recorded between the two: it is of a clone of the card.
        let is_of_clone =
            is_whole && is_there && self.sessions.has_other(card, before.number, number, session);
        // Files without a sector lie between the two at most.
        let is_far = is_whole && number - before.number > LOOKED_AT_MAX;
        (is_absent || is_far || is_of_clone).then_some(Misnamed::Ahead { before: before.number })
    }

    /// How a log follows the one before it of the same power-on, which is given where it ends before this one.
    fn follow(&mut self, next: &mut Ending) -> Option<Latest> {
        let (card, Some(number)) = place(&next.name) else { return None };
        let summary = &next.summary;
        let (Some(session), Some(first), Some(last)) =
            (summary.session, summary.first_number, summary.last_number)
        else {
            return None;
        };
        let key = (card.to_owned(), session);
        // Where the card was out for a moment, the next log has all of the sector that was in progress.
        let end = last.wrapping_add(u32::from(!summary.ends_partial));
        let earlier = self.latest.get(&key).copied();
        next.power_on = match earlier {
            Some(earlier) => self.after(&earlier, next, number, first),
            None => self.begins(next, number),
        };
        // Where logs are out of order, those that follow are held against what goes further.
        let summary = &next.summary;
        let check_end = summary.check_end.filter(|_| !summary.ends_partial);
        let latest = Latest { number, end, frames_end: summary.frames_end, check_end, last: summary.last };
        let latest = earlier.filter(|earlier| earlier.end > end).unwrap_or(latest);
        self.latest.insert(key, Latest { number, ..latest });
        earlier.filter(|earlier| earlier.end <= first)
    }

    /// Of a log that is not the first one of its power-on.
    fn after(&mut self, earlier: &Latest, next: &Ending, number: u32, first: u32) -> PowerOn {
        let (card, _) = place(&next.name);
        let after = earlier.number;
        // What the vehicle sent before it was armed is kept from here on at most.
        let from = next.summary.keep.map_or(first, |keep| keep.from.min(first));
        if first < earlier.end {
            return PowerOn::Disordered { after };
        }
        // Those that it used up while it waited hold nothing.
        let waited = numbers_waited(next, earlier.end, earlier.last.unwrap_or(Instant::ZERO));
        let absent = self.sessions.absent(card, after, number).saturating_sub(waited);
        let missing = from.saturating_sub(earlier.end);
        let frames = next.summary.frames_before.zip(earlier.frames_end);
        let frames = frames.map(|(here, there)| here.wrapping_sub(there)).filter(|frames| *frames < 1 << 31);
        match (missing, absent) {
            (0, 0) => {
                self.prove(earlier, next, first);
                PowerOn::Follows
            }
            (0, _) => PowerOn::Renamed { after },
            (_, 0) if self.shorten(next, missing, frames.filter(|_| from == first)) => PowerOn::Follows,
            _ => {
                let seconds = next.summary.first.zip(earlier.last);
                let seconds = seconds.map(|(first, last)| first.since(last).as_micros() as f64 / 1e6);
                PowerOn::Missing { after: Some(after), sectors: missing, frames, seconds }
            }
        }
    }

    /// The log before `next` of the same power-on, if it is at hand.
    fn before(&mut self, next: &Ending) -> Option<&mut Ending> {
        let is_before = |log: &&mut Ending| {
            log.summary.session == next.summary.session && place(&log.name).0 == place(&next.name).0
        };
        self.held.iter_mut().filter_map(Logged::ending).rev().find(is_before)
    }

    /// Of the log before `next` nothing is missing: `next`, which begins with sector `first`, has what came then, or a vehicle
    /// that waited did not keep it.
    fn prove(&mut self, earlier: &Latest, next: &Ending, first: u32) {
        let frames = next.summary.frames_before.zip(earlier.frames_end);
        // The sector in progress is in the next log again.
        let has_all = frames.is_some_and(|(here, there)| there.wrapping_sub(here) < 1 << 31);
        let goes_on = first == earlier.end && has_all;
        let checks = next.summary.check_before.zip(earlier.check_end);
        if goes_on && checks.is_some_and(|(here, there)| here != there) {
            if let Some(log) = self.before(next) {
                log.proof = Proof::Differs;
            }
            return;
        }
        let is_short = |log: &Ending| matches!(log.proof, Proof::Short { by: Teller::Parity, .. });
        if let Some(log) = self.before(next).filter(|log| !log.proof.is_whole() && !is_short(log)) {
            let waited = log.summary.keep.is_some() && log.summary.marks.moved.is_none();
            if goes_on || first > earlier.end && waited {
                log.proof = Proof::NextLog;
            }
        }
    }

    /// The end of the log before `next` is missing; whether that log is at hand. Of one that ended in order none is.
    fn shorten(&mut self, next: &Ending, sectors: u32, frames: Option<u32>) -> bool {
        let Some(log) = self.before(next).filter(|log| log.proof != Proof::Closed) else { return false };
        log.proof = Proof::Short { sectors, frames, by: Teller::NextLog };
        true
    }

    /// Of the first log of a power-on that is there.
    fn begins(&self, next: &Ending, number: u32) -> PowerOn {
        let (card, _) = place(&next.name);
        let (Some(keep), Some(before)) = (next.summary.keep, next.summary.marks.before) else {
            return PowerOn::First;
        };
        if keep.from == 0 {
            return PowerOn::First;
        }
        // Its boot record names the number before the first one of the power-on. Where all numbers since are there, what was
        // recorded before is on another card, or files were renamed.
        let waited = numbers_waited(next, keep.from, Instant::ZERO);
        let session = next.summary.session.unwrap_or_default();
        let is_missing = self.sessions.absent(card, before.number, number) > waited
            || self.sessions.has_other(card, before.number, number, session);
        if !is_missing || !self.sessions.has_older(card, number) {
            return PowerOn::NotRead;
        }
        let (frames, seconds) = (next.summary.frames_before, next.summary.first.map(Instant::as_secs_f64));
        PowerOn::Missing { after: None, sectors: keep.from, frames, seconds }
    }

    /// The start of `next` found no sector in the newest files, of which the last one has this number: those that are empty now
    /// were so then.
    fn tell_empty(&mut self, newest: u32, next: &str) {
        for log in self.held.iter_mut().filter_map(Logged::ending) {
            let ((card, number), blocks) = (place(&log.name), &log.summary.blocks);
            let is_looked_at = number.is_some_and(|number| {
                number <= newest && newest - number < LOOKED_AT_MAX && log.files.len() == 1
            });
            let is_empty = blocks.empty + blocks.erased == blocks.blocks;
            if card == place(next).0 && is_looked_at && is_empty && log.summary.session.is_none() {
                log.proof = Proof::NextStart(None);
            }
        }
    }

    /// What the start of `next` found of the log before it.
    fn tell(&mut self, before: &Before, next: &mut Ending) {
        let (card, number) = place(&next.name);
        let mut held: Vec<&mut Ending> = self.held.iter_mut().filter_map(Logged::ending).collect();
        // The start looked at the log's last file, which was to be written anew and held another session's sectors.
        let named = (card, Some(before.number));
        if self.sessions.may_be_oldest(card, before.session)
            && let Some(log) = held.iter_mut().find(|log| place(&log.name) == named)
            && log.confirm_begun_anew(before.session)
        {
            next.before = SessionBefore::There;
            return;
        }
        // Its place is between a log that was read and the next one, on the same card; or a log of its number is there, and
        // is another session.
        let is_looked_at = |name: &str| {
            let (other, read) = place(name);
            let numbers = number.zip(read);
            card == other && numbers.is_some_and(|(next, read)| read <= before.number && before.number < next)
        };
        let is_looked_at = held.iter().any(|log| is_looked_at(&log.name));
        let numbers = self.sessions.numbers(card, before.session);
        // A power-on by arming has several logs: one that ends earlier is not the one that was found.
        let is_earlier = |log: &Ending| {
            log.summary.session == Some(before.session)
                && place(&log.name).1.is_some_and(|read| read < before.number)
                && log.summary.last_number.is_some_and(|last| last.wrapping_add(1) < before.sectors)
                && log.summary.keep.is_some()
        };
        let is_earlier = held.iter().any(|log| is_earlier(log));
        // Numbers go up, so where a lower one is there, this one was not written over. What began on another card may have
        // lost what it found on this one.
        let began_here = next.summary.first_number == Some(0) || next.summary.keep.is_some();
        let is_looked_at =
            is_looked_at || began_here && self.sessions.has_older(card, before.number.saturating_add(1));
        let read = self.latest.get(&(card.to_owned(), before.session));
        let is_earlier =
            is_earlier || read.is_some_and(|read| read.number < before.number && read.end < before.sectors);
        let elsewhere = numbers.first().copied().filter(|_| !numbers.contains(&before.number) && !is_earlier);
        match held.iter_mut().rev().find(|log| log.summary.session == Some(before.session)) {
            Some(log) => {
                log.proof = Proof::of(&log.summary, Some(before));
                let is_gone = is_earlier && !numbers.contains(&before.number);
                next.before = if is_gone { SessionBefore::Gone(before.number) } else { SessionBefore::There };
            }
            None if numbers.contains(&before.number) => next.before = SessionBefore::There,
            None if is_looked_at => next.before = SessionBefore::Gone(before.number),
            None => next.before = SessionBefore::NotLookedFor(before.number),
        }
        // What the recorder had begun to write anew is told there.
        let elsewhere = elsewhere.filter(|there| self.sessions.begun_anew_number(card, *there).is_none());
        if let Some(there) = elsewhere {
            next.before = SessionBefore::Elsewhere { number: before.number, there };
        }
        // A later log of a power-on has the boot record of its start, which was before the logs between them.
        if next.summary.keep.is_some_and(|keep| keep.from > 0) {
            return;
        }
        // The start looked at each file from the newest on until it found a sector.
        for log in held.into_iter().filter(|log| log.summary.session.is_none()) {
            let (other, empty) = place(&log.name);
            let is_after = |empty: u32| before.number < empty && number.is_some_and(|next| empty < next);
            if card == other && empty.is_some_and(is_after) {
                log.proof = Proof::NextStart(None);
            }
        }
    }
}

/// Numbers that a log by arming may have used up, at most, while its vehicle waited, from this sector and time on: its files
/// then take one name after the other, and only the last ones are kept.
fn numbers_waited(log: &Ending, from: u32, since: Instant) -> u32 {
    let summary = &log.summary;
    let (Some(keep), Some(first)) = (summary.keep, summary.first_number) else { return 0 };
    let sectors = u64::from(first.saturating_sub(keep.from.max(from)));
    let waited = summary.first.map_or(Span::ZERO, |time| time.since(since));
    let files = sectors / FILE_SECTORS_MIN + waited.as_micros() / FILE_AGE_MIN.as_micros();
    u32::try_from(files / FILES_A_NUMBER).unwrap_or(u32::MAX)
}

#[cfg(test)]
mod tests {
    use std::fs;

    use hums_blackbox::Sector;
    use hums_blackbox::record::Keep;

    use super::*;
    use crate::logs::find;
    use crate::logs::marks::Marks;
    use crate::logs::strangers::{Others, Strange};

    impl Logged for Ending {
        fn ending(&mut self) -> Option<&mut Self> {
            Some(self)
        }
    }

    #[test]
    fn a_last_file_that_was_to_be_written_anew_is_no_finding_once_the_next_start_found_it_so() {
        let others = Others { sectors: 9, first: 0, last: 8, session: 7, board: None, several: false };
        let strange = vec![Strange {
            file: 1,
            hollow: true,
            passed: false,
            older: false,
            others: Some(others),
            shift: None,
        }];
        let mut log = Ending {
            name: "00006".to_owned(),
            files: vec!["00006_00.HUM".to_owned(), "00006_01.HUM".to_owned()],
            ..Ending::default()
        };
        log.summary.session = Some(8);
        log.summary.strange = strange;
        assert!(log.strange().join("").contains("had just begun to write it anew"), "{:?}", log.strange());
        let mut next = Ending { name: "00007".to_owned(), ..Ending::default() };
        next.summary.session = Some(9);
        let before = Before { found: Found::Frames, number: 6, session: 7, ..Before::default() };
        next.summary.marks.before = Some(before);
        let mut followed = Followed::new(Sessions::default());
        let mut done = followed.push(log);
        done.extend(followed.push(next));
        done.extend(followed.finish());
        assert_eq!(done[0].strange(), Vec::<String>::new());
        assert_eq!(done[1].before, SessionBefore::There);
    }

    #[test]
    fn what_is_missing_after_a_log_that_ended_in_order_is_not_its_own() {
        let logs = |proof| {
            let [mut one, mut two] = [("00001", 0, 99), ("00002", 628, 900)].map(|(name, first, last)| {
                let mut log = Ending { name: name.to_owned(), ..Ending::default() };
                (log.summary.session, log.summary.first_number, log.summary.last_number) =
                    (Some(7), Some(first), Some(last));
                log
            });
            (one.proof, one.summary.frames_end, two.summary.frames_before) = (proof, Some(50), Some(70));
            two.proof = Proof::Closed;
            let mut followed = Followed::new(Sessions::default());
            let mut done = followed.push(one);
            done.extend(followed.push(two));
            done.extend(followed.finish());
            (done[0].proof, done[1].power_on)
        };
        let (proof, power_on) = logs(Proof::Closed);
        assert_eq!(proof, Proof::Closed);
        assert!(
            matches!(power_on, PowerOn::Missing { after: Some(1), sectors: 528, frames: Some(20), .. }),
            "{power_on:?}"
        );
        let short = Proof::Short { sectors: 528, frames: Some(20), by: Teller::NextLog };
        assert_eq!(logs(Proof::None), (short, PowerOn::Follows));
    }

    #[test]
    fn a_file_that_was_emptied_since_the_start_is_told() {
        let is_told = |from| {
            let mut logs = ["00002", "00003", "00004"].map(|name| Ending {
                name: name.to_owned(),
                files: vec![format!("{name}_00.HUM")],
                ..Ending::default()
            });
            let [one, empty, next] = &mut logs;
            (one.summary.session, one.summary.last_number) = (Some(7), Some(8));
            empty.summary.strange = vec![Strange {
                file: 0,
                hollow: true,
                passed: false,
                older: false,
                others: None,
                shift: None,
            }];
            next.summary.session = Some(9);
            next.summary.keep = Some(Keep { from, ..Keep::default() });
            let before =
                Before { found: Found::Frames, number: 2, session: 7, sectors: 9, ..Before::default() };
            next.summary.marks.before = Some(before);
            let mut followed = Followed::new(Sessions::default());
            let mut done: Vec<_> = logs.into_iter().flat_map(|log| followed.push(log)).collect();
            done.extend(followed.finish());
            !done[1].is_sound()
        };
        assert!(!is_told(0), "the start found it empty");
        assert!(is_told(429), "the start was before it was written");
    }

    #[test]
    fn an_empty_file_is_no_finding_once_the_next_start_found_nothing_to_read() {
        let ending = |damaged, number| {
            let strange =
                Strange { file: 0, hollow: true, passed: false, older: false, others: None, shift: None };
            let mut log =
                Ending { name: "00001".into(), files: vec!["00001_00.HUM".into()], ..Ending::default() };
            log.summary.strange = vec![strange];
            let blocks = &mut log.summary.blocks;
            (blocks.blocks, blocks.empty, blocks.damaged) = (900 + damaged, 900, damaged);
            let mut next = Ending { name: "00002".into(), ..Ending::default() };
            next.summary.session = Some(9);
            next.summary.marks.before =
                Some(Before { found: Found::Unreadable, number, ..Before::default() });
            let mut followed = Followed::new(Sessions::default());
            let mut done = followed.push(log);
            done.extend(followed.push(next));
            done.extend(followed.finish());
            done.first().is_some_and(Ending::is_sound)
        };
        assert!(ending(0, 1));
        assert!(!ending(1, 1), "what is damaged may have been a sector");
        assert!(!ending(0, 0) && !ending(0, 4), "the start did not look at it");
    }

    #[test]
    fn a_number_that_is_not_a_power_ons_own_is_told_by_what_its_start_found() {
        let dir = tempfile::tempdir().expect("a folder");
        let mut sector = Sector::from_bytes([0; 512]);
        sector.seal(7);
        let mut bytes = *sector.bytes();
        bytes[..2].copy_from_slice(&[0x48, 0xb3]);
        let mut sector = Sector::from_bytes(bytes);
        sector.seal(7);
        fs::write(dir.path().join("00004_00.HUM"), sector.bytes()).expect("room");
        let found = find(&[dir.path().to_owned()], false).expect("a folder");
        let names: Vec<_> = found.logs.iter().map(|log| (place(&log.name).0, log)).collect();
        let card = names.first().map_or("", |(card, _)| card);
        let sessions = || Sessions::of(found.logs.iter().map(|log| (log.name.as_str(), log)));
        let misnamed =
            |name: &str, first: u32, keep: Option<u32>, found: Found, number: u32, is_alone: bool| {
                let (card, sessions) = if is_alone { ("", Sessions::default()) } else { (card, sessions()) };
                let name = if card.is_empty() { name.to_owned() } else { format!("{card}/{name}") };
                let mut log = Ending { name, ..Ending::default() };
                (log.summary.session, log.summary.first_number) = (Some(9), Some(first));
                log.summary.keep = keep.map(|from| Keep { from, ..Keep::default() });
                log.summary.marks.before = Some(Before { found, number, session: 7, ..Before::default() });
                Followed::<Ending>::new(sessions).misnamed(&log)
            };
        let (nothing, frames) = (Found::Nothing, Found::Frames);
        // The first session of a card, whole or as far as it was kept; a later log of the same power-on has a later number.
        assert_eq!(misnamed("00002", 0, None, nothing, 0, true), Some(Misnamed::First));
        assert_eq!(misnamed("00002", 70, Some(0), nothing, 0, true), Some(Misnamed::First));
        assert_eq!(misnamed("00001", 0, None, nothing, 0, true), None);
        assert_eq!(
            misnamed("00000", 0, None, nothing, 0, true),
            Some(Misnamed::First),
            "numbers begin with 1"
        );
        assert_eq!(misnamed("00002", 70, Some(60), nothing, 0, true), None);
        assert_eq!(misnamed("00005", 0, None, nothing, 0, false), Some(Misnamed::First), "another card's");
        assert_eq!(misnamed("00005", 70, Some(70), nothing, 0, false), None, "another card was in the box");
        // The session before is not there: two files without a sector may have been.
        assert_eq!(misnamed("00007", 0, None, frames, 4, true), None);
        assert_eq!(misnamed("00008", 0, None, frames, 4, true), Some(Misnamed::Ahead { before: 4 }));
        // It is there, and no file between.
        assert_eq!(misnamed("00006", 70, Some(0), frames, 4, false), Some(Misnamed::Ahead { before: 4 }));
        assert_eq!(misnamed("00005", 70, Some(0), frames, 4, false), None);
        assert_eq!(misnamed("00006", 70, Some(60), frames, 4, false), None);
        // Another session was recorded between them: on the card of which this one's was a copy.
        sector.seal(8);
        fs::write(dir.path().join("00005_00.HUM"), sector.bytes()).expect("room");
        let more = find(&[dir.path().to_owned()], false).expect("a folder");
        let sessions = Sessions::of(more.logs.iter().map(|log| (log.name.as_str(), log)));
        let mut log = Ending { name: format!("{card}/00006"), ..Ending::default() };
        (log.summary.session, log.summary.first_number) = (Some(9), Some(0));
        for (number, expected) in [(4, Some(Misnamed::Ahead { before: 4 })), (5, None)] {
            let session = number + 3;
            log.summary.marks.before = Some(Before { found: frames, number, session, ..Before::default() });
            assert_eq!(Followed::<Ending>::new(sessions.clone()).misnamed(&log), expected);
        }
        // One that no recorder made.
        log.summary.marks = Marks { packed: true, ..Marks::default() };
        assert_eq!(Followed::<Ending>::new(sessions).misnamed(&log), Some(Misnamed::Packed));
        assert_eq!(Followed::<Ending>::new(Sessions::default()).misnamed(&log), None, "alone");
        // Who waits takes a number more for each hundred files, which have 128 sectors or last for 5 s.
        assert_eq!(misnamed("00002", 12_800, Some(0), nothing, 0, true), None);
        assert_eq!(misnamed("00002", 12_799, Some(0), nothing, 0, true), Some(Misnamed::First));
        assert_eq!(misnamed("00003", 12_800, Some(0), nothing, 0, true), Some(Misnamed::First));
        assert_eq!(misnamed("00006", 12_800, Some(0), frames, 4, false), None);
        assert_eq!(misnamed("00006", 12_800, None, frames, 4, false), None);
    }
}
