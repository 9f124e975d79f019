//! What the vehicle's components say in words: `STATUSTEXT`, long ones put together from their parts.

use hums_core::time::{Instant, Span};
use hums_link::encode::COMPONENT;
use hums_link::{Check, Frame};

use super::history::Note;
use crate::mavlink::values::{Payload, Value};

/// A text of several parts that lacks the next one for so long is as long as it is.
const PATIENCE: Span = Span::from_secs(1);
/// The longest text that is put together, bytes.
const BYTES_MAX: usize = 1_000;
/// A part with less than this is the last one: it has a NUL.
const PART_BYTES: usize = 50;
/// What a finding of a HUMS begins with.
const OURS: &str = "HUMS: ";

/// A text whose next part may still come.
#[derive(Clone, Debug)]
struct Open {
    at: Instant,
    component: u8,
    id: u16,
    severity: u8,
    words: String,
}

/// Puts texts together.
#[derive(Clone, Debug, Default)]
pub struct Texts(Option<Open>);

impl Texts {
    /// Takes a `STATUSTEXT`.
    pub fn frame(&mut self, at: Instant, frame: &Frame<'_>, out: &mut impl FnMut(Instant, Note)) {
        if frame.check() != Check::Verified {
            return;
        }
        let Some(message) = hums_dialect::message(frame.id()) else { return };
        let payload = Payload::new(message, frame.payload());
        let Some(bytes) = payload.fields().find_map(|(_, value)| match value {
            Value::Text(bytes) => Some(bytes.to_vec()),
            _ => None,
        }) else {
            return;
        };
        let id = payload.number("id").unwrap_or(0.0) as u16;
        let words = String::from_utf8_lossy(&bytes).into_owned();
        let last = id == 0 || bytes.len() < PART_BYTES;
        match &mut self.0 {
            Some(open) if id != 0 && open.id == id && open.component == frame.component() => {
                if open.words.len() < BYTES_MAX {
                    open.words.push_str(&words);
                }
            }
            _ => {
                self.close(out);
                let severity = payload.number("severity").unwrap_or(0.0) as u8;
                self.0 = Some(Open { at, component: frame.component(), id, severity, words });
            }
        }
        if last {
            self.close(out);
        }
    }

    /// What has waited long enough is told.
    pub fn tick(&mut self, now: Instant, out: &mut impl FnMut(Instant, Note)) {
        if self.0.as_ref().is_some_and(|open| now.since(open.at) > PATIENCE) {
            self.close(out);
        }
    }

    fn close(&mut self, out: &mut impl FnMut(Instant, Note)) {
        let Some(open) = self.0.take() else { return };
        let ours = open.component == COMPONENT && open.words.starts_with(OURS);
        let from = match open.component {
            COMPONENT if ours => "on board".to_owned(),
            1 => "autopilot".to_owned(),
            other => format!("component {other}"),
        };
        let words = if ours { open.words.trim_start_matches(OURS).to_owned() } else { open.words };
        let level = match open.severity {
            0..=2 => "critical",
            3 | 4 => "warning",
            5 => "advisory",
            _ => "ok",
        };
        let kind = if ours { "finding" } else { "text" };
        out(open.at, Note { at_s: open.at.as_secs_f64(), kind, level, from, subsystem: "", words });
    }
}
