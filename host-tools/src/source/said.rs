//! What MAVLink frames say, as items: observations, parameters, modes, and texts put together from their parts.

use anyhow::Result;
use hums_core::observation::{Autopilot, Observation};
use hums_core::time::Instant;
use hums_link::encode::COMPONENT;
use hums_link::packet::Fields;
use hums_link::{Check, Frame, observe};

use super::item::{Item, Mode, Parameter, Take, Text, Want};
use crate::mavlink::ids::{PARAM_VALUE, STATUSTEXT};
use crate::statustext::{self, Texts};

/// Turns frames into items, in their order.
#[derive(Debug, Default)]
pub(super) struct Said {
    texts: Texts,
    /// Who speaks, as far as it matters how a parameter is coded.
    autopilot: Autopilot,
}

impl Said {
    /// Hands on a frame, where frames are wanted, and what it says.
    pub(super) fn frame(
        &mut self,
        at: Instant,
        frame: &Frame<'_>,
        want: Want<'_>,
        take: &mut Take<'_>,
    ) -> Result<()> {
        if want.frames {
            take(at, Item::Frame(frame))?;
        }
        if frame.check() != Check::Verified {
            return Ok(());
        }
        match frame.id() {
            STATUSTEXT => self.text(at, frame, take),
            PARAM_VALUE if frame.component() != COMPONENT => parameter(at, frame, self.autopilot, take),
            _ => {
                let Some((source, observation)) = observe(frame) else { return Ok(()) };
                if let Observation::Heartbeat(heartbeat) = &observation {
                    self.autopilot = heartbeat.autopilot;
                    take(at, Item::Mode(Mode { number: heartbeat.mode, name: None }))?;
                }
                if want.observations { take(at, Item::Observation(source, &observation)) } else { Ok(()) }
            }
        }
    }

    /// Nothing follows.
    pub(super) fn end(&mut self, take: &mut Take<'_>) -> Result<()> {
        hand_texts(take, |hand| self.texts.end(&mut |text| hand(text)))
    }

    fn text(&mut self, at: Instant, frame: &Frame<'_>, take: &mut Take<'_>) -> Result<()> {
        let Some(text) = statustext::Text::of(at, frame.source(), frame.payload()) else { return Ok(()) };
        hand_texts(take, |hand| self.texts.take(text, &mut |text| hand(text)))
    }
}

/// Hands on the texts that `make` gives; each has the time of its first part.
fn hand_texts(take: &mut Take<'_>, make: impl FnOnce(&mut dyn FnMut(statustext::Text))) -> Result<()> {
    let mut result = Ok(());
    make(&mut |text| {
        if result.is_ok() {
            let said = Text { source: text.source, severity: text.severity, words: &text.words };
            result = take(text.at, Item::Text(said));
        }
    });
    result
}

/// `PARAM_VALUE`. An integer is the bits of the float at PX4, and a number like any other at ArduPilot
/// (MAVLink parameter protocol: byte-wise and cast encoding).
fn parameter(at: Instant, frame: &Frame<'_>, autopilot: Autopilot, take: &mut Take<'_>) -> Result<()> {
    const INT32: u8 = 6;
    let mut payload = [0; 25];
    payload.iter_mut().zip(frame.payload()).for_each(|(to, from)| *to = *from);
    let fields = Fields(&payload);
    let Some(name) = fields.text(8, 16) else { return Ok(()) };
    let value = fields.f32(0);
    let bits = autopilot == Autopilot::Px4 && payload[24] == INT32;
    let value = if bits { f64::from(value.to_bits().cast_signed()) } else { f64::from(value) };
    take(at, Item::Parameter(Parameter { name, value }))
}
