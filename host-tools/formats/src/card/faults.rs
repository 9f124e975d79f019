//! Faults of a card, as on the command line.

use std::str::FromStr;

use crate::utc::{parse_seconds, seconds_to_micros};

/// Faults of one run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Faults {
    /// Power cuts; the first one ends the run.
    pub cuts: Vec<Cut>,
    /// Pauses.
    pub stalls: Vec<Stall>,
    /// Spans without a card.
    pub outs: Vec<CardOut>,
    /// Probability that a block write fails and changes nothing.
    pub write_error: f64,
    /// Makes the write errors repeatable.
    pub seed: u64,
    /// Block 0 is write protected: a user's image is never formatted.
    pub keeps_table: bool,
}

/// `--cut-after-writes N[:torn]`
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Cut {
    /// Block write at which power goes, from 1.
    pub write: u64,
    /// Half of that block is old.
    pub torn: bool,
}

impl FromStr for Cut {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (count, torn) = match text.split_once(':') {
            None => (text, false),
            Some((count, "torn")) => (count, true),
            Some(_) => return Err(format!("`{text}` is not N or N:torn")),
        };
        match count.parse() {
            Ok(write) if write > 0 => Ok(Self { write, torn }),
            _ => Err(format!("`{count}` is no number of block writes (1 or more)")),
        }
    }
}

/// `--stall MS@T`
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stall {
    /// Start, microseconds since the first input byte.
    pub from_us: u64,
    /// Duration, microseconds.
    pub for_us: u64,
}

impl FromStr for Stall {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong =
            || format!("`{text}` is not MS@T, for instance 2500@60 (milliseconds, from second 60 on)");
        let (ms, from) = text.split_once('@').ok_or_else(wrong)?;
        let ms: f64 = ms.parse().map_err(|_| wrong())?;
        Ok(Self {
            for_us: seconds_to_micros(ms / 1e3).ok_or_else(wrong)?,
            from_us: parse_seconds(from).ok_or_else(wrong)?,
        })
    }
}

/// `--card-out T..T`
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CardOut {
    /// Start, microseconds since the first input byte.
    pub from_us: u64,
    /// End, likewise; `u64::MAX` for never.
    pub to_us: u64,
}

impl FromStr for CardOut {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("`{text}` is not T..T, for instance 30..45.5 (seconds; `30..` for good)");
        let (from, to) = text.split_once("..").ok_or_else(wrong)?;
        let from_us = if from.is_empty() { 0 } else { parse_seconds(from).ok_or_else(wrong)? };
        let to_us = if to.is_empty() { u64::MAX } else { parse_seconds(to).ok_or_else(wrong)? };
        if from_us < to_us { Ok(Self { from_us, to_us }) } else { Err(wrong()) }
    }
}

/// A probability as text.
pub fn probability(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.0..=1.0).contains(&value) => Ok(value),
        _ => Err(format!("`{text}` is no probability: 0 to 1, for instance 0.001")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_forms_of_the_contract() {
        assert_eq!("17".parse(), Ok(Cut { write: 17, torn: false }));
        assert_eq!("17:torn".parse(), Ok(Cut { write: 17, torn: true }));
        assert_eq!("2500@60".parse(), Ok(Stall { from_us: 60_000_000, for_us: 2_500_000 }));
        assert_eq!("30..45.5".parse(), Ok(CardOut { from_us: 30_000_000, to_us: 45_500_000 }));
        assert_eq!("30..".parse(), Ok(CardOut { from_us: 30_000_000, to_us: u64::MAX }));
        assert_eq!(probability("0.001"), Ok(0.001));
    }

    #[test]
    fn what_makes_no_sense_is_refused() {
        for text in ["", "0", "-1", "x", "5:half", "5:"] {
            assert!(text.parse::<Cut>().is_err(), "{text}");
        }
        for text in ["", "2500", "@", "5@-1", "nan@3", "inf@3", "3@1e300"] {
            assert!(text.parse::<Stall>().is_err(), "{text}");
        }
        for text in ["", "5", "5..4", "5..5", "a..b"] {
            assert!(text.parse::<CardOut>().is_err(), "{text}");
        }
        for text in ["-0.1", "1.1", "nan", ""] {
            assert!(probability(text).is_err(), "{text}");
        }
    }
}
