//! Logs in order, each with the end that a later one recorded.
//!
//! Each start notes the end of the session before: a log is held back until the next ones were read. A file from the
//! moment of a power cut has no sector, and so no such record.

use std::collections::VecDeque;

use hums_blackbox::record::{LastSession, PreviousEnd};

use crate::ending::{Ending, Proof, SessionBefore};
use crate::logs::sessions::{Sessions, place};

/// Files that a start looks at (`SEGMENTS_MAX` of the recorder).
const LOOKED_AT_MAX: u32 = 3;
/// Later logs that may record an end.
pub const HELD_MAX: usize = 4;

/// The result of a log that was read.
pub trait HasEnding {
    /// Its end, if it is a HUMS log.
    fn ending(&mut self) -> Option<&mut Ending>;
}

/// Holds logs back while a later one may record their end.
#[derive(Debug)]
pub struct EndResolver<T> {
    held: VecDeque<T>,
    sessions: Sessions,
}

impl<T: HasEnding> EndResolver<T> {
    /// For logs with known sessions.
    pub const fn new(sessions: Sessions) -> Self {
        Self { held: VecDeque::new(), sessions }
    }

    /// Returns the logs whose end is settled, in order. A log of another program waits for at most one other log.
    pub fn push(&mut self, mut next: T) -> Vec<T> {
        let mut has_sectors = false;
        if let Some(ending) = next.ending() {
            has_sectors = ending.summary.session.is_some();
            ending.again = self.sessions.again(&ending.name).map(str::to_owned);
            if let Some(before) = ending.summary.marks.before
                && ending.is_counted()
            {
                if before.has_end() {
                    self.tell(&before, ending);
                } else if before.found == PreviousEnd::Unreadable {
                    self.tell_empty(before.number, &ending.name);
                }
            }
        }
        self.held.push_back(next);
        // The next start found the newest log with sectors.
        let keep = if has_sectors { 1 } else { HELD_MAX };
        let mut done = Vec::new();
        while self.held.len() > keep || self.held.front_mut().is_some_and(|log| log.ending().is_none()) {
            done.extend(self.held.pop_front());
        }
        done
    }

    /// Ends the list of logs.
    pub fn finish(self) -> impl Iterator<Item = T> {
        self.held.into_iter()
    }

    /// The start of `next` found no sector in files up to `newest`. Files that are empty now were empty then.
    fn tell_empty(&mut self, newest: u32, next: &str) {
        for log in self.held.iter_mut().filter_map(HasEnding::ending) {
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

    fn tell(&mut self, before: &LastSession, next: &mut Ending) {
        let (card, number) = place(&next.name);
        let mut held: Vec<&mut Ending> = self.held.iter_mut().filter_map(HasEnding::ending).collect();
        // The last file was to be written anew, and held another session's sectors.
        let named = (card, Some(before.number));
        if self.sessions.may_be_oldest(card, before.session)
            && let Some(log) = held.iter_mut().find(|log| place(&log.name) == named)
            && log.confirm_begun_anew(before.session)
        {
            next.before = SessionBefore::There;
            return;
        }
        // The log's place is between two logs of the card, or its number is there with another session.
        let is_looked_at = |name: &str| {
            let (other, read) = place(name);
            let numbers = number.zip(read);
            card == other && numbers.is_some_and(|(next, read)| read <= before.number && before.number < next)
        };
        let is_looked_at = held.iter().any(|log| is_looked_at(&log.name));
        // Numbers go up: with a lower one there, this one was not overwritten. A log that began on another card may
        // have lost the record of this one.
        let began_here = next.summary.first_number == Some(0);
        let is_looked_at =
            is_looked_at || began_here && self.sessions.has_older(card, before.number.saturating_add(1));
        let is_there = self.sessions.numbers(card, before.session).contains(&before.number);
        next.before = match held.iter_mut().rev().find(|log| log.summary.session == Some(before.session)) {
            Some(log) => {
                log.proof = Proof::of(&log.summary, Some(before));
                SessionBefore::There
            }
            None if is_there => SessionBefore::There,
            None if is_looked_at => SessionBefore::Gone(before.number),
            None => SessionBefore::NotLookedFor(before.number),
        };
        // A start looks at files from the newest on until it finds a sector.
        for log in held.into_iter().filter(|log| log.summary.session.is_none()) {
            let (other, empty) = place(&log.name);
            let is_after = |empty: u32| before.number < empty && number.is_some_and(|next| empty < next);
            if card == other && empty.is_some_and(is_after) {
                log.proof = Proof::NextStart(None);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::logs::strangers::ForeignSectors;

    impl HasEnding for Ending {
        fn ending(&mut self) -> Option<&mut Self> {
            Some(self)
        }
    }

    impl HasEnding for Option<Ending> {
        fn ending(&mut self) -> Option<&mut Ending> {
            self.as_mut()
        }
    }

    #[test]
    fn only_a_hums_log_and_what_follows_it_wait_for_later_ones() {
        let mut followed = EndResolver::new(Sessions::default());
        let waiting = |followed: &mut EndResolver<_>, log: Option<Ending>| followed.push(log).len();
        assert_eq!([None, None].map(|log| waiting(&mut followed, log)), [1, 1]);
        assert_eq!([Some(Ending::default()), None].map(|log| waiting(&mut followed, log)), [0, 0]);
        let mut log = Ending::default();
        log.summary.session = Some(9);
        assert_eq!([Some(log), None].map(|log| waiting(&mut followed, log)), [2, 0]);
        assert_eq!(followed.finish().count(), 2);
    }

    #[test]
    fn a_last_file_that_was_to_be_written_anew_is_no_finding_once_the_next_start_found_it_so() {
        let strange = vec![ForeignSectors { file: 1, hollow: true, sectors: 9, first: 0, session: 7 }];
        let mut log = Ending {
            name: "00006".to_owned(),
            files: vec!["00006_00.HUM".to_owned(), "00006_01.HUM".to_owned()],
            ..Ending::default()
        };
        log.summary.session = Some(8);
        log.summary.strange = strange;
        assert!(log.strange().join("").contains("9 sectors of 00006_01.HUM"), "{:?}", log.strange());
        let mut next = Ending { name: "00007".to_owned(), ..Ending::default() };
        next.summary.session = Some(9);
        let before =
            LastSession { found: PreviousEnd::Frames, number: 6, session: 7, ..LastSession::default() };
        next.summary.marks.before = Some(before);
        let mut followed = EndResolver::new(Sessions::default());
        let mut done = followed.push(log);
        done.extend(followed.push(next));
        done.extend(followed.finish());
        assert_eq!(done[0].strange(), Vec::<String>::new());
        assert_eq!(done[1].before, SessionBefore::There);
    }

    #[test]
    fn an_empty_file_is_no_finding_once_the_next_start_found_nothing_to_read() {
        let ending = |damaged, number| {
            let mut log =
                Ending { name: "00001".into(), files: vec!["00001_00.HUM".into()], ..Ending::default() };
            log.summary.strange =
                vec![ForeignSectors { file: 0, hollow: true, sectors: 0, first: 0, session: 0 }];
            let blocks = &mut log.summary.blocks;
            (blocks.blocks, blocks.empty, blocks.damaged) = (900 + damaged, 900, damaged);
            let mut next = Ending { name: "00002".into(), ..Ending::default() };
            next.summary.session = Some(9);
            next.summary.marks.before =
                Some(LastSession { found: PreviousEnd::Unreadable, number, ..LastSession::default() });
            let mut followed = EndResolver::new(Sessions::default());
            let mut done = followed.push(log);
            done.extend(followed.push(next));
            done.extend(followed.finish());
            done.first().is_some_and(Ending::is_sound)
        };
        assert!(ending(0, 1));
        assert!(!ending(1, 1), "what is damaged may have been a sector");
        assert!(!ending(0, 0) && !ending(0, 4), "the start did not look at it");
    }
}
