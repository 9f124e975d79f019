//! The autopilot's parameters: first values, and changes.

use std::collections::BTreeMap;

use hums_core::clock::Instant;
use serde::Serialize;

use super::more::ParameterDefault;

/// Parameters at most: `ArduPilot` has some 1,400. Further ones are counted.
const PARAMETERS_MAX: usize = 3_000;
/// Changes of one that are kept; of more the last ones replace each other.
const CHANGES_MAX: usize = 16;

/// All reported parameters.
#[derive(Clone, Debug, Default)]
pub struct Parameters {
    known: BTreeMap<String, Vec<(Instant, f64)>>,
    defaults: BTreeMap<String, ParameterDefault>,
    /// Values of parameters beyond [`PARAMETERS_MAX`].
    left_out: u64,
    newest: Option<Instant>,
}

/// A parameter for the page.
#[derive(Clone, Debug, Serialize)]
pub struct ParameterJson {
    name: String,
    /// Times, seconds, and values: the first one, and each change.
    values: Vec<(f64, f64)>,
    #[serde(skip_serializing_if = "Option::is_none")]
    default: Option<f64>,
}

impl Parameters {
    /// Takes a value; ignores NaN and infinity.
    pub fn take(&mut self, at: Instant, name: &str, value: f64) {
        if !value.is_finite() {
            return;
        }
        if !self.known.contains_key(name) && self.known.len() >= PARAMETERS_MAX {
            self.left_out += 1;
            return;
        }
        let values = self.known.entry(name.to_owned()).or_default();
        if values.last().is_some_and(|(_, last)| last.to_bits() == value.to_bits()) {
            return;
        }
        if values.len() > CHANGES_MAX {
            values.pop();
        }
        values.push((at, value));
        self.newest = Some(at);
    }

    /// Takes a parameter's default.
    pub fn learn_default(&mut self, default: &ParameterDefault) {
        let known = self.defaults.get(&default.name);
        let has_room = known.is_some() || self.defaults.len() < PARAMETERS_MAX;
        if has_room && known.is_none_or(|known| default.is_of_airframe || !known.is_of_airframe) {
            self.defaults.insert(default.name.clone(), default.clone());
        }
    }

    /// Whether the log has defaults of parameters.
    pub fn tells_defaults(&self) -> bool {
        !self.defaults.is_empty()
    }

    /// Last value of each.
    pub fn last(&self) -> impl Iterator<Item = (&str, f64)> {
        self.known.iter().filter_map(|(name, values)| Some((name.as_str(), values.last()?.1)))
    }

    /// Values of parameters that there was no room for.
    pub fn left_out(&self) -> u64 {
        self.left_out
    }

    /// Parameters reported after `from` (`None`: ever), with all their values up to `until`.
    pub fn since(&self, from: Option<Instant>, until: Instant) -> Vec<ParameterJson> {
        if self.newest.is_none() || from.is_some_and(|from| self.newest <= Some(from)) {
            return Vec::new();
        }
        let parameter = |(name, values): (&String, &Vec<(Instant, f64)>)| {
            let known = values.get(..values.partition_point(|(at, _)| *at <= until))?;
            let (last, _) = known.last()?;
            let values = known.iter().map(|(at, value)| (at.as_secs_f64(), *value)).collect();
            let default = self.defaults.get(name).map(|default| default.value);
            from.is_none_or(|from| *last > from).then(|| ParameterJson {
                name: name.clone(),
                values,
                default,
            })
        };
        self.known.iter().filter_map(parameter).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_of_an_airframe_comes_before_that_of_the_system() {
        let mut parameters = Parameters::default();
        parameters.take(Instant::ZERO, "MC_ROLL_P", 8.0);
        assert!(!parameters.tells_defaults());
        let default =
            |value, is_of_airframe| ParameterDefault { name: "MC_ROLL_P".to_owned(), value, is_of_airframe };
        for (value, is_of_airframe) in [(6.5, false), (7.0, true), (6.5, false)] {
            parameters.learn_default(&default(value, is_of_airframe));
        }
        let told = parameters.since(None, Instant::ZERO);
        assert_eq!((told[0].default, parameters.tells_defaults()), (Some(7.0), true));
    }

    #[test]
    fn a_parameter_is_told_when_it_is_new_and_when_it_changed_and_none_is_without_end() {
        let (mut parameters, at) = (Parameters::default(), Instant::from_millis);
        for (second, value) in [(1, 5.0), (2, 5.0), (3, 6.0), (4, f64::NAN)] {
            parameters.take(at(second * 1000), "RTL_ALT", value);
        }
        let first = parameters.since(None, at(2_500));
        assert_eq!(first[0].values, [(1.0, 5.0)], "no future");
        assert_eq!(parameters.since(Some(at(2_500)), at(9_000))[0].values, [(1.0, 5.0), (3.0, 6.0)]);
        assert!(parameters.since(Some(at(9_000)), at(9_500)).is_empty());
        for number in 0..4_000 {
            parameters.take(at(10_000), &format!("P{number}"), 1.0);
            parameters.take(at(10_000), "RTL_ALT", f64::from(number));
        }
        let all = parameters.since(None, at(10_000));
        assert_eq!((all.len(), parameters.left_out()), (PARAMETERS_MAX, 1_001));
        assert!(all.iter().all(|parameter| parameter.values.len() <= CHANGES_MAX + 1));
        assert_eq!(all.last().expect("it is").values.last(), Some(&(10.0, 3_999.0)), "the last one is known");
    }
}
