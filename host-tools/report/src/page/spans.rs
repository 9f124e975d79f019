//! States of a vehicle in a row: phases of flight, modes. Each one lasts until the next begins.

use std::borrow::Cow;

use hums_core::clock::{Instant, Span};

/// Maximum number of spans; later ones count to the last one.
const SPANS_MAX: usize = 2_000;

/// Beginnings, in order.
#[derive(Clone, Debug, Default)]
pub struct Spans {
    begun: Vec<(Instant, Cow<'static, str>)>,
    revision: u64,
}

/// The part of it that a page has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SentSpans {
    revision: u64,
    count: usize,
}

/// The part that a page lacks: the number of its spans that stay, and the spans after those: seconds and
/// name.
pub type Rest = (usize, Vec<(f64, Cow<'static, str>)>);

impl Spans {
    /// Enters this state. A span shorter than `shortest` is removed, and becomes part of the one before. So
    /// does a span of zero length, also the first.
    pub fn extend(&mut self, at: Instant, name: Cow<'static, str>, shortest: Span) {
        if let Some((begun, last)) = self.begun.last() {
            if *last == name || self.begun.len() >= SPANS_MAX {
                return;
            }
            if at <= *begun || at.since(*begun) < shortest && self.begun.len() > 1 {
                self.begun.pop();
            }
        }
        self.revision += 1;
        if self.begun.last().is_none_or(|(_, last)| *last != name) {
            self.begun.push((at, name));
        }
    }

    /// The first one, while it is the only one, was this one.
    pub fn begin_as(&mut self, name: Cow<'static, str>) {
        if let [(_, first)] = self.begun.as_mut_slice()
            && *first != name
        {
            self.revision += 1;
            *first = name;
        }
    }

    /// The part up to `until` that a page with these spans lacks; `None` if there is nothing new.
    pub fn since(&self, seen: &mut SentSpans, until: Instant) -> Option<Rest> {
        let count = self.begun.partition_point(|(at, _)| *at <= until);
        let now = SentSpans { revision: self.revision, count };
        if *seen == now {
            return None;
        }
        let stay = seen.count.min(count).saturating_sub(1);
        *seen = now;
        let rest = self.begun.get(stay..count).unwrap_or_default();
        Some((stay, rest.iter().map(|(at, name)| (at.as_secs_f64(), name.clone())).collect()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seconds(second: u64) -> Instant {
        Instant::from_millis(second * 1000)
    }

    #[test]
    fn what_it_was_in_before_that_was_seen_is_the_first_one() {
        let mut spans = Spans::default();
        spans.extend(seconds(0), "ground".into(), Span::from_secs(2));
        spans.begin_as("hover".into());
        spans.extend(seconds(1), "hover".into(), Span::from_secs(2));
        spans.extend(seconds(9), "climb".into(), Span::from_secs(2));
        spans.begin_as("cruise".into());
        let (_, whole) = spans.since(&mut SentSpans::default(), seconds(100)).expect("all of it");
        assert_eq!(whole, [(0.0, "hover".into()), (9.0, "climb".into())]);
    }

    #[test]
    fn a_page_that_follows_has_what_a_page_has_that_comes_late_and_short_ones_are_taken_back() {
        let (mut spans, mut seen, mut page) = (Spans::default(), SentSpans::default(), Vec::new());
        for (second, name) in [(0, "a"), (10, "b"), (11, "a"), (20, "c"), (21, "d"), (22, "e"), (40, "b")] {
            spans.extend(seconds(second), name.into(), Span::from_secs(2));
            if let Some((stay, rest)) = spans.since(&mut seen, seconds(second)) {
                page.truncate(stay);
                page.extend(rest);
            }
        }
        let (_, whole) = spans.since(&mut SentSpans::default(), seconds(100)).expect("all of it");
        assert_eq!(page, whole);
        let names: Vec<_> = whole.iter().map(|(at_s, name)| (*at_s as u64, &**name)).collect();
        assert_eq!(names, [(0, "a"), (22, "e"), (40, "b")]);
        assert!(
            spans.since(&mut SentSpans::default(), seconds(30)).expect("a part").1.len() == 2,
            "no future"
        );
    }
}
