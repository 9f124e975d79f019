//! Components' texts: `STATUSTEXT`, joined from parts.

use hums_core::cause::Alert;
use hums_core::clock::{Instant, Span};
use hums_core::observation::Source;
use hums_link::alert;
use hums_link::packet::Fields;

/// Wait for the next part, without which a text ends.
const PATIENCE: Span = Span::from_secs(1);
/// At a time. One more completes all.
const SENDERS_MAX: usize = 64;
/// A joined text.
const BYTES_MAX: usize = 1_000;
/// A shorter part has a NUL: the last one.
const PART_BYTES: usize = 50;

/// A text, or one message's part.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StatusText {
    /// When its first part came.
    pub at: Instant,
    /// Who says it.
    pub source: Source,
    /// `MAV_SEVERITY`: 0 emergency, 7 debugging.
    pub severity: u8,
    /// Untrusted, never markup.
    pub words: String,
    /// The alert in it, once it is put together.
    pub alert: Option<Alert>,
    /// Shared by its parts; 0 for a single one.
    id: u16,
    /// Nothing follows.
    ends: bool,
}

impl StatusText {
    /// A whole text.
    pub fn whole(at: Instant, source: Source, severity: u8, words: &str) -> Self {
        Self { at, source, severity, words: words.to_owned(), alert: None, id: 0, ends: true }
    }

    /// A finding's level of this severity.
    pub fn level(&self) -> &'static str {
        level(self.severity)
    }

    /// The frame's checksum must hold.
    pub fn of(at: Instant, source: Source, payload: &[u8]) -> Self {
        let fields = Fields(payload);
        let text: [u8; PART_BYTES] = fields.bytes(1);
        let bytes = text.split(|byte| *byte == 0).next().unwrap_or_default();
        let (severity, id) = (fields.u8(0), fields.u16(1 + PART_BYTES));
        let words = String::from_utf8_lossy(bytes).into_owned();
        let ends = id == 0 || bytes.len() < PART_BYTES;
        Self { at, source, severity, words, alert: None, id, ends }
    }
}

/// A finding's level, as pages colour it. `MAV_SEVERITY`: failure of a primary system (critical and above), of a secondary one
/// (error).
pub fn level(severity: u8) -> &'static str {
    match severity {
        0..=2 => "critical",
        3 | 4 => "warning",
        5 => "advisory",
        _ => "ok",
    }
}

/// Joins texts, one of each sender at a time.
#[derive(Clone, Debug, Default)]
pub struct Texts(Vec<StatusText>);

impl Texts {
    /// Hands on whole texts.
    pub fn take(&mut self, next: StatusText, whole: &mut impl FnMut(StatusText)) {
        self.pass(next.at, whole);
        let (source, id, ends) = (next.source, next.id, next.ends);
        let is_full = self.0.len() >= SENDERS_MAX;
        self.complete(whole, |open| is_full || open.source == source && (open.id != id || id == 0));
        match self.0.iter_mut().find(|open| open.source == source) {
            Some(open) if open.words.len() < BYTES_MAX => open.words.push_str(&next.words),
            Some(_) => {}
            None => self.0.push(next),
        }
        self.complete(whole, |open| open.source == source && ends);
    }

    /// Ends texts that waited long enough.
    pub fn pass(&mut self, now: Instant, whole: &mut impl FnMut(StatusText)) {
        self.complete(whole, |open| now.since(open.at) > PATIENCE);
    }

    /// Nothing follows.
    pub fn end(&mut self, whole: &mut impl FnMut(StatusText)) {
        self.complete(whole, |_| true);
    }

    fn complete(&mut self, whole: &mut impl FnMut(StatusText), is_complete: impl Fn(&StatusText) -> bool) {
        for mut text in self.0.extract_if(.., |open| is_complete(open)) {
            text.alert = alert::of_text(Some(text.severity), text.words.as_bytes());
            whole(text);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SOURCE: Source = Source { system: 1, component: 1 };

    fn part(at_ms: u64, id: u16, words: &str) -> StatusText {
        let mut payload = vec![4];
        payload.extend_from_slice(words.as_bytes());
        payload.resize(51, 0);
        payload.extend_from_slice(&id.to_le_bytes());
        StatusText::of(Instant::from_millis(at_ms), SOURCE, &payload)
    }

    fn told(parts: impl IntoIterator<Item = StatusText>) -> Vec<String> {
        let (mut texts, mut told) = (Texts::default(), Vec::new());
        let mut take = |text: StatusText| told.push(text.words);
        parts.into_iter().for_each(|part| texts.take(part, &mut take));
        texts.end(&mut take);
        told
    }

    #[test]
    fn parts_of_one_number_are_one_text_and_the_next_text_of_that_number_is_another() {
        let long = "a".repeat(50);
        let parts =
            [part(0, 7, &long), part(10, 7, "b"), part(20, 7, "c"), part(30, 0, "d"), part(40, 0, "e")];
        assert_eq!(told(parts), [format!("{long}b"), "c".into(), "d".into(), "e".into()]);
    }

    #[test]
    fn two_senders_may_talk_at_the_same_time() {
        let long = "a".repeat(50);
        let other = |text: StatusText| StatusText { source: Source { system: 1, component: 191 }, ..text };
        let parts = [part(0, 7, &long), other(part(1, 7, &long)), part(2, 7, "b"), other(part(3, 7, "c"))];
        assert_eq!(told(parts), [format!("{long}b"), format!("{long}c")]);
    }

    #[test]
    fn a_text_whose_end_was_lost_is_told_as_far_as_it_came() {
        let long = "a".repeat(50);
        assert_eq!(told([part(0, 7, &long), part(1_500, 7, "b")]), [long.clone(), "b".into()]);
        assert_eq!(told([part(0, 7, &long), part(10, 0, "b")]), [long, "b".into()]);
    }

    #[test]
    fn a_text_without_end_is_bounded() {
        let long = "a".repeat(50);
        let told = told((0..100).map(|at| part(at, 7, &long)));
        assert!(told.iter().all(|words| words.len() <= BYTES_MAX), "{}", told.len());
    }
}
