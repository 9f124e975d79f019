//! `--params FILE` ([`hums_link::param_line`]).

use std::path::Path;
use std::sync::Arc;

use anyhow::{Context, Result};
use hums_core::parameters::{Param, ParamError, ParamSpec, Params};
use hums_link::param_line::{self, Line};

use crate::files::read_short;
use crate::outcome::usage;

/// A vehicle's file has some 40 KiB.
const BYTES_MAX: u64 = 1 << 20;

/// Limits of the user; others are defaults, or those of a log or a box.
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

    /// Whether the user has set any.
    pub fn are_given(&self) -> bool {
        !self.given.is_empty()
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

/// Parameters in order; none without a file.
pub fn read(path: Option<&Path>) -> Result<Vec<(&'static ParamSpec, f32)>> {
    let Some(path) = path else { return Ok(Vec::new()) };
    let bytes = read_short(path, BYTES_MAX).context("--params")?;
    let text = String::from_utf8(bytes).map_err(|_| {
        usage(format!("--params {}: is not a text file; give lines of NAME VALUE", path.display()))
    })?;
    let mut params = Vec::new();
    for (index, line) in text.lines().enumerate() {
        match parameter(line) {
            Ok(parameter) => params.extend(parameter),
            Err(why) => {
                return Err(usage(format!("--params {}, line {}: {why}", path.display(), index + 1)));
            }
        }
    }
    Ok(params)
}

/// `Err`: the line's error.
fn parameter(line: &str) -> Result<Option<(&'static ParamSpec, f32)>, String> {
    let (name, value) = match param_line::read(line) {
        Line::Nothing => return Ok(None),
        Line::Set(name, value) => (name, value),
        Line::Wrong => return Err("wants NAME VALUE, for instance CELL_VOLT_WARN 3.6".to_owned()),
    };
    let Some(param) = Param::find(name) else {
        return Err(format!("there is no parameter {name}"));
    };
    let number = value.parse().ok().filter(|number| {
        // The table itself decides.
        !matches!(Params::defaults().set(name, *number), Err(ParamError::OutOfRange { .. }))
    });
    let (spec, unit) = (param.spec(), param.words().unit);
    let ParamSpec { min, max, .. } = spec;
    let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
    number
        .map(|number| Some((spec, number)))
        .ok_or_else(|| format!("{name} takes {min} to {max}{unit}, not {value}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn set(line: &str) -> Option<(&'static str, f32)> {
        parameter(line).expect(line).map(|(spec, value)| (spec.name, value))
    }

    #[test]
    fn the_files_of_every_ground_station_are_read() {
        for line in [
            "CELL_VOLT_WARN,3.5",
            "CELL_VOLT_WARN 3.5",
            "  CELL_VOLT_WARN\t3.50 # lipo",
            "1\t191\tCELL_VOLT_WARN\t3.5\t9",
        ] {
            assert_eq!(set(line), Some(("CELL_VOLT_WARN", 3.5)), "{line}");
        }
        for line in ["", "  ", "# Onboard parameters for Vehicle 1", "1\t1\tARMING_CHECK\t1\t6"] {
            assert_eq!(set(line), None, "{line}");
        }
    }

    #[test]
    fn what_is_wrong_is_told_with_the_range() {
        for (line, why) in [
            ("CELL_VOLT_WARN", "wants NAME VALUE"),
            ("CELL_VOLT_WARN 3.5 3.6", "wants NAME VALUE"),
            ("CELL_VOLT_WARN 9", "CELL_VOLT_WARN takes 0 to 4.5 V, not 9"),
            ("CELL_VOLT_WARN nan", "CELL_VOLT_WARN takes 0 to 4.5 V, not nan"),
            ("CELL_VOLT_WARN high", "CELL_VOLT_WARN takes 0 to 4.5 V, not high"),
            ("BAT_CELLS 99", "BAT_CELLS takes 0 to 24, not 99"),
            ("cell_volt_warn 3.5", "there is no parameter cell_volt_warn"),
            ("1 191 NO_SUCH 1 9", "there is no parameter NO_SUCH"),
        ] {
            let error = parameter(line).expect_err(line);
            assert!(error.contains(why), "{line}: {error}");
        }
    }
}
