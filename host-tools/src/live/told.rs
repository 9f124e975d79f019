//! Settings and part hours of the box on board: limits here are its own.

use std::sync::Arc;

use hums_core::parameters::{ParamSpec, Params};
use hums_link::encode::COMPONENT;
use hums_link::packet::Fields;
use hums_link::{Check, Frame};

use crate::mavlink::ids::PARAM_VALUE;
pub use crate::source::told::MonitorRecord;

/// The user's, and the box's for all others.
#[derive(Clone, Debug, Default)]
pub struct Limits {
    params: Params,
    given: Arc<[&'static str]>,
}

impl Limits {
    /// Limits with these given values, in this order.
    pub fn new(given: &[(&'static ParamSpec, f32)]) -> Self {
        let mut limits = Self::default();
        for (spec, value) in given {
            // Checked when read.
            let _ = limits.params.set(spec.name, *value);
        }
        limits.given = given.iter().map(|(spec, _)| spec.name).collect();
        limits
    }

    /// The present values.
    pub fn params(&self) -> &Params {
        &self.params
    }

    /// Unknown parameters and values out of range change nothing.
    pub fn take(&self, params: &mut Params, name: &str, value: f32) {
        if !self.given.contains(&name) {
            let _ = params.set(name, value);
        }
    }

    /// As [`Self::take`], for all vehicles that come.
    pub fn learn(&mut self, name: &str, value: f32) {
        let mut params = self.params;
        self.take(&mut params, name, value);
        self.params = params;
    }
}

/// A part's place from 0, of `CMP1_KIND`.
pub fn place_of(name: &str) -> Option<usize> {
    name.strip_prefix("CMP")?.strip_suffix("_KIND")?.parse::<usize>().ok()?.checked_sub(1)
}

/// Sent to a ground station.
pub fn parameter(frame: &Frame<'_>) -> Option<(String, f32)> {
    if frame.id() != PARAM_VALUE || frame.component() != COMPONENT || frame.check() != Check::Verified {
        return None;
    }
    let mut payload = [0; 25];
    for (to, from) in payload.iter_mut().zip(frame.payload()) {
        *to = *from;
    }
    let fields = Fields(&payload);
    Some((fields.text(8, 16)?.to_owned(), fields.f32(0)))
}
