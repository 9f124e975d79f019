//! MAVLink frames as items: observations, parameters, modes, texts.

use anyhow::Result;
use hums_core::cause::Alert;
use hums_core::clock::Instant;
use hums_core::observation::{Autopilot, Observation};
use hums_link::alert::event_name;
use hums_link::encode::COMPONENT;
use hums_link::packet::Fields;
use hums_link::{Check, Frame, LongTexts, observe};

use super::dataflash::is_firmware;
use super::item::{AUTOPILOT, Event, Fact, FactKind, Item, ItemSink, Mode, Needs, Parameter, Text};
use crate::mavlink::ids::{EVENT, PARAM_VALUE, STATUSTEXT};
use crate::statustext::{self, Texts};

#[derive(Debug, Default)]
pub(super) struct FrameReports {
    texts: Texts,
    long_texts: LongTexts,
    /// Decides how parameters are coded.
    autopilot: Autopilot,
}

impl FrameReports {
    pub(super) fn frame(
        &mut self,
        at: Instant,
        frame: &Frame<'_>,
        want: Needs<'_>,
        take: &mut ItemSink<'_>,
    ) -> Result<()> {
        if want.leaves_out(frame.source()) {
            return Ok(());
        }
        if want.frames {
            take(at, Item::Frame(frame))?;
        }
        if frame.check() != Check::Verified {
            return Ok(());
        }
        hand_texts(take, |hand| self.texts.pass(at, &mut |text| hand(text)))?;
        let mut result = Ok(());
        self.long_texts.frame(at, frame, &mut |source, alert| {
            if want.observations && result.is_ok() {
                result = take(at, Item::Observation(source, &Observation::Alert(alert)));
            }
        });
        result?;
        let observed = observe(frame);
        let alert = match &observed {
            Some((_, Observation::Alert(alert))) => Some(*alert),
            _ => None,
        };
        match frame.id() {
            STATUSTEXT => self.text(at, frame, take)?,
            EVENT => event(at, frame, alert, take)?,
            PARAM_VALUE => {
                if let Some((name, value)) = parameter(frame, self.autopilot) {
                    take(at, Item::Parameter(Parameter { name: &name, value }))?;
                }
            }
            _ => {}
        }
        let Some((source, observation)) = observed else { return Ok(()) };
        if let Observation::Heartbeat(heartbeat) = &observation {
            self.autopilot = heartbeat.autopilot;
            take(at, Item::Mode(Mode { number: heartbeat.mode, name: None }))?;
        }
        if want.observations { take(at, Item::Observation(source, &observation)) } else { Ok(()) }
    }

    /// The recording ends.
    pub(super) fn end(&mut self, take: &mut ItemSink<'_>) -> Result<()> {
        hand_texts(take, |hand| self.texts.end(&mut |text| hand(text)))
    }

    fn text(&mut self, at: Instant, frame: &Frame<'_>, take: &mut ItemSink<'_>) -> Result<()> {
        let text = statustext::StatusText::of(at, frame.source(), frame.payload());
        hand_texts(take, |hand| self.texts.take(text, &mut |text| hand(text)))
    }
}

fn hand_texts(
    take: &mut ItemSink<'_>,
    make: impl FnOnce(&mut dyn FnMut(statustext::StatusText)),
) -> Result<()> {
    let mut result = Ok(());
    make(&mut |text| {
        if result.is_ok() {
            result = hand_text(&text, take);
        }
    });
    result
}

/// `ArduPilot` names its firmware in a text, when parameters are requested (`send_banner`).
fn hand_text(text: &statustext::StatusText, take: &mut ItemSink<'_>) -> Result<()> {
    let words = text.words.as_str();
    if text.source.component == AUTOPILOT && is_firmware(words) {
        take(text.at, Item::Fact(Fact { about: FactKind::Firmware, words }))?;
    }
    let statustext::StatusText { source, severity, alert, .. } = *text;
    take(text.at, Item::Text(Text { source, severity, words, alert }))
}

/// Number, name if known, external level. From 8 on it is not for people.
fn event(at: Instant, frame: &Frame<'_>, alert: Option<Alert>, take: &mut ItemSink<'_>) -> Result<()> {
    let fields = Fields(frame.payload());
    let (number, severity) = (fields.u32(0), fields.u8(12) & 0xF);
    let words = event_name(number).unwrap_or_default();
    let event = Event { source: frame.source(), number, severity, words, alert };
    if severity < 8 { take(at, Item::Event(event)) } else { Ok(()) }
}

/// A parameter's value in a report; `None` for other frames. PX4 sends an integer as the bits of the float,
/// ArduPilot as a number (MAVLink parameter protocol: byte-wise and cast encoding).
pub fn parameter(frame: &Frame<'_>, autopilot: Autopilot) -> Option<(String, f64)> {
    const INT32: u8 = 6;
    if frame.id() != PARAM_VALUE || frame.component() == COMPONENT || frame.check() != Check::Verified {
        return None;
    }
    let fields = Fields(frame.payload());
    let (name, value) = (fields.text(8, 16)?, fields.f32(0));
    let bits = autopilot == Autopilot::Px4 && fields.u8(24) == INT32;
    let value = if bits { f64::from(value.to_bits().cast_signed()) } else { f64::from(value) };
    Some((name.to_owned(), value))
}

#[cfg(test)]
mod tests {
    use hums_link::encode::{Encoder, FRAME_BYTES_MAX};
    use hums_link::messages;
    use hums_link::statustext::Severity;

    use super::*;

    fn firmware(component: u8, words: &str) -> Option<String> {
        let (mut encoder, mut buffer) = (Encoder::of(1, component), [0; FRAME_BYTES_MAX]);
        let bytes = encoder.frame(&mut buffer, &messages::status_text(Severity::Info, words));
        let frame = Frame::parse(bytes).expect("a frame of ours");
        let (mut said, mut firmware) = (FrameReports::default(), None);
        let mut take = |_: Instant, item: Item<'_>| {
            if let Item::Fact(Fact { about: FactKind::Firmware, words }) = item {
                firmware = Some(words.to_owned());
            }
            Ok(())
        };
        said.frame(Instant::ZERO, &frame, Needs::default(), &mut take).expect("no error");
        said.end(&mut take).expect("no error");
        firmware
    }

    #[test]
    fn the_firmware_of_a_tlog_is_what_the_autopilot_says_it_is() {
        assert_eq!(
            firmware(1, "ArduCopter V4.6.3 (3fc7011a)").as_deref(),
            Some("ArduCopter V4.6.3 (3fc7011a)")
        );
        assert_eq!(firmware(1, "EKF3 IMU0 is using GPS"), None);
        assert_eq!(firmware(191, "ArduCopter V4.6.3 (3fc7011a)"), None, "who is no autopilot tells nothing");
    }
}
