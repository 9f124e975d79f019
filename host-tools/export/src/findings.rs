//! The findings of a log as texts of the box (`STATUSTEXT` of component 191) between the frames of a tlog, for programs
//! that show texts.

use std::collections::VecDeque;

use anyhow::Result;
use hums_core::health::Level;
use hums_link::encode::{COMPONENT, Encoder, FRAME_BYTES_MAX};
use hums_link::statustext::Severity;
use hums_link::{messages, summary};

use super::context::Context;
use crate::check;
use crate::check::judge::{HeardAt, Limits};
use crate::mavlink::frame::{Peek, peek};
use crate::source::recording::LogPlace;
use crate::source::told::Finding;

/// Bytes of time before each frame of a tlog.
const TIME_BYTES: usize = 8;

/// The findings of a log, and the system that they are about.
#[derive(Clone, Debug, Default)]
pub struct Findings {
    system: u8,
    list: Vec<Finding>,
}

impl Findings {
    /// As `hums check` has them.
    pub fn of(place: &LogPlace) -> Result<Self> {
        let judged = check::recording(place, &Limits::default(), HeardAt::Somewhere)?.judged;
        let system = judged.vehicle().source.map_or(1, |source| source.system);
        Ok(Self { system, list: judged.findings })
    }
}

/// The texts that are still to be written, the next first: their times in the tlog, and their frames.
pub struct Texts(VecDeque<(u64, Vec<u8>)>);

impl Texts {
    /// Of the findings in the wanted part of a log.
    pub fn of(context: &Context) -> Option<Self> {
        let Findings { system, list } = context.findings.as_ref()?;
        let mut encoder = Encoder::of(*system, COMPONENT);
        let mut buffer = [0; FRAME_BYTES_MAX];
        let wanted = list.iter().filter(|finding| context.selection.has_time(finding.at, &context.epochs));
        let texts = wanted.filter_map(|finding| {
            let packet =
                messages::status_text(severity(finding)?, summary::text(&finding.of_box()?).as_str());
            let utc_us = context.epochs.utc_us(finding.at).unwrap_or_else(|| finding.at.as_micros());
            Some((utc_us, encoder.frame(&mut buffer, &packet).to_vec()))
        });
        Some(Self(texts.collect()))
    }

    /// Number of texts to come.
    pub fn count(&self) -> u64 {
        self.0.len() as u64
    }

    /// Records of a tlog with the texts that are due between them.
    pub fn among(&mut self, mut records: &[u8]) -> Vec<u8> {
        let mut merged = Vec::with_capacity(records.len());
        while let Some((time, frame)) = records.split_first_chunk::<TIME_BYTES>() {
            self.push_until(u64::from_be_bytes(*time), &mut merged);
            let Peek::Frame(frame) = peek(frame) else { break };
            let (record, rest) = records.split_at(TIME_BYTES + frame.bytes().len());
            merged.extend_from_slice(record);
            records = rest;
        }
        merged.extend_from_slice(records);
        merged
    }

    /// The texts after the last record.
    pub fn rest(&mut self) -> Vec<u8> {
        let mut rest = Vec::new();
        self.push_until(u64::MAX, &mut rest);
        rest
    }

    fn push_until(&mut self, utc_us: u64, to: &mut Vec<u8>) {
        let due = self.0.iter().take_while(|(at, _)| *at <= utc_us).count();
        for (at, frame) in self.0.drain(..due) {
            to.extend(at.to_be_bytes());
            to.extend(frame);
        }
    }
}

fn severity(finding: &Finding) -> Option<Severity> {
    match (finding.level, finding.previous) {
        (Level::Critical, _) => Some(Severity::Critical),
        (Level::Warning, _) => Some(Severity::Warning),
        (Level::Ok, Level::Warning | Level::Critical) => Some(Severity::Info),
        _ => None,
    }
}
