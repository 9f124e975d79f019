//! `hums box params`.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use hums_link::Frame;
use hums_link::packet::{Fields, Packet};
use hums_link::signing::{KEY_BYTES, Key};
use serde::Serialize;

use super::Client;
use crate::cli::{self, Link, ParamsAction};
use crate::mavlink::ids::{
    PARAM_REQUEST_LIST, PARAM_REQUEST_READ, PARAM_SET, PARAM_VALUE, SETUP_SIGNING, STATUSTEXT,
};
use crate::outcome::{Outcome, usage};
use crate::output::{self, Schema};
use crate::printable;
use crate::talk;

/// Pause in a list: the missing values are lost.
const GAP: Duration = Duration::from_millis(1_500);
const ANSWER: Duration = Duration::from_millis(700);
const TRIES: usize = 8;
/// Answers to earlier requests that may come before that to a `PARAM_SET`.
const STALE_MAX: usize = 2;
/// `MAV_PARAM_TYPE_REAL32`
const REAL32: u8 = 9;
/// More parameters than a box has.
const COUNT_MAX: u16 = 4_096;

/// `PARAM_VALUE`
pub(super) struct Param {
    pub(super) name: String,
    pub(super) value: f32,
    index: u16,
    count: u16,
    /// `MAV_PARAM_TYPE`
    pub(super) kind: u8,
}

/// Runs `hums box params`.
pub fn run(args: &cli::Params) -> Result<Outcome> {
    match &args.action {
        ParamsAction::List { at } => {
            let mut client = Client::connect(at)?;
            let system = client.system();
            let (values, wrong) = list(&mut client)?;
            show(system, values, at.json)?;
            for why in &wrong {
                note!("system {system}: {why}");
            }
            return Ok(Outcome::lossy(!wrong.is_empty()));
        }
        ParamsAction::Get { names, at } => {
            let mut client = Client::connect(at)?;
            let system = client.system();
            let values = names.iter().map(|name| read(&mut client, name));
            if at.json {
                show(system, values.collect::<Result<Vec<_>>>()?, true)?;
            } else {
                // A later one may fail.
                values.into_iter().try_for_each(|value| show(system, [value?], false))?;
            }
        }
        ParamsAction::Sign { at, remove } => {
            let system = sign(at, *remove)?;
            if at.json {
                output::json(SIGNED, &KeyJson { system, has_key: !*remove })?;
            } else {
                output::line(if *remove { "key removed" } else { "key set" })?;
            }
        }
        ParamsAction::Set { name, value, at } => {
            let (wanted, is_rounded) = single(*value).with_context(|| name.clone())?;
            if is_rounded {
                note!("{name}: {value} is rounded to {wanted}: a parameter has single precision");
            }
            let mut client = Client::connect(at)?;
            let system = client.system();
            let kept = set(&mut client, name, wanted, REAL32)?;
            if kept.value.to_bits() != wanted.to_bits() {
                bail!("system {system}: {name}: the box refused {wanted} and keeps {}", kept.value);
            }
            show(system, [kept], at.json)?;
        }
    }
    Ok(Outcome::Done)
}

const VALUES: Schema = Schema::first("hums-params");
const SIGNED: Schema = Schema::first("hums-params-sign");

#[derive(Debug, Serialize)]
struct KeyJson {
    /// MAVLink system id of the box's vehicle.
    system: u8,
    /// False after its removal.
    has_key: bool,
}

fn show(system: u8, values: impl IntoIterator<Item = Param>, json: bool) -> Result<()> {
    if json {
        let values = values.into_iter().map(|value| (shown(&value.name), f64::from(value.value).into()));
        let object: serde_json::Map<_, _> =
            std::iter::once(("system".to_owned(), system.into())).chain(values).collect();
        return output::json(VALUES, &object);
    }
    values.into_iter().try_for_each(|value| output::line(&format!("{} {}", shown(&value.name), value.value)))
}

const fn is_of_names(c: char) -> bool {
    c.is_ascii_uppercase() || c.is_ascii_digit() || c == '_'
}

/// Fits into NAME VALUE and our JSON: other characters become numbers.
fn shown(name: &str) -> String {
    if name.is_empty() {
        return '\0'.escape_unicode().to_string();
    }
    printable::rewritten(name, |c| !is_of_names(c), |out, c| out.extend(c.escape_unicode())).into_owned()
}

/// And whether rounding changes it, as printed.
fn single(wanted: f64) -> Result<(f32, bool)> {
    let value = wanted as f32;
    if wanted.is_finite() && value.is_infinite() {
        return Err(usage(format!("{wanted:e} is more than a parameter can have: {:e} at most", f32::MAX)));
    }
    Ok((value, wanted.is_finite() && value.to_string().parse() != Ok(wanted)))
}

/// Sends or removes the key; returns the box's system. The box answers with a text.
fn sign(at: &Link, remove: bool) -> Result<u8> {
    let path = at.key.as_deref();
    let key = match path {
        Some(path) => talk::key(path)?,
        None if remove => Key([0; KEY_BYTES]),
        None => return Err(usage("params sign: no key is given; add --key FILE")),
    };
    // Unsigned: the box trusts this port.
    let mut client = Client::connect(&Link { key: None, ..at.clone() })?;
    let key = if remove { Key([0; KEY_BYTES]) } else { key };
    let (system, component) = client.target();
    let packet =
        Packet::new(SETUP_SIGNING).u64(0, talk::stamp_now()).u8(8, system).u8(9, component).bytes(10, &key.0);
    let text = if remove { "HUMS: signing key removed" } else { "HUMS: signing key set" };
    let said = client.ask(&packet, ANSWER, TRIES, |frame| {
        let fields = Fields(frame.payload());
        (frame.id() == STATUSTEXT && fields.text(1, 50) == Some(text)).then_some(())
    })?;
    said.with_context(|| {
        format!(
            "system {system}: the box does not take the key; set SIGN_PORT to this port (docs/companion.md)"
        )
    })?;
    Ok(system)
}

fn no_answer(system: u8, name: &str) -> String {
    format!("system {system}: {name}: no answer; is there such a parameter?")
}

/// Ended by a zero or the 16th byte.
fn name_of(bytes: [u8; 16]) -> String {
    let name = bytes.split(|byte| *byte == 0).next().unwrap_or_default();
    String::from_utf8_lossy(name).into_owned()
}

fn value_of(frame: &Frame<'_>) -> Option<Param> {
    let fields = Fields(frame.payload());
    (frame.id() == PARAM_VALUE).then(|| Param {
        name: name_of(fields.bytes(8)),
        value: fields.f32(0),
        index: fields.u16(6),
        count: fields.u16(4),
        kind: fields.u8(24),
    })
}

pub(super) fn value(client: &mut Client, name: &str) -> Result<f32> {
    read(client, name).map(|param| param.value)
}

fn read(client: &mut Client, name: &str) -> Result<Param> {
    ask(client, name, TRIES)?.with_context(|| no_answer(client.system(), name))
}

/// `None` if no answer comes: an autopilot does not answer for an unknown name.
pub(super) fn ask(client: &mut Client, name: &str, tries: usize) -> Result<Option<Param>> {
    let (system, component) = client.target();
    let packet =
        Packet::new(PARAM_REQUEST_READ).u16(0, u16::MAX).u8(2, system).u8(3, component).text(4, 16, name);
    client.ask(&packet, ANSWER, tries, |frame| value_of(frame).filter(|value| value.name == name))
}

/// Returns the value that the other side keeps. `kind`: `MAV_PARAM_TYPE`.
pub(super) fn set(client: &mut Client, name: &str, value: f32, kind: u8) -> Result<Param> {
    let (system, component) = client.target();
    let packet =
        Packet::new(PARAM_SET).f32(0, value).u8(4, system).u8(5, component).text(6, 16, name).u8(22, kind);
    let mut others = Vec::new();
    let kept = client.ask(&packet, ANSWER, TRIES, |frame| {
        let param = value_of(frame).filter(|param| param.name == name)?;
        if param.value.to_bits() == value.to_bits() || others.len() == STALE_MAX {
            return Some(param);
        }
        others.push(param);
        None
    })?;
    kept.or_else(|| others.pop()).with_context(|| no_answer(system, name))
}

/// And its faults; lost values are requested one by one.
fn list(client: &mut Client) -> Result<(Vec<Param>, Vec<String>)> {
    let (system, component) = client.target();
    let request = Packet::new(PARAM_REQUEST_LIST).u8(0, system).u8(1, component);
    let first = client.ask(&request, GAP, TRIES, value_of)?.with_context(|| {
        format!("system {system}: no parameters were received; check the link, and call again")
    })?;
    let said = first.count;
    let count = said.min(COUNT_MAX);
    let mut wrong = Vec::new();
    if said != count {
        wrong.push(format!("the box says that it has {said} parameters; {count} of them are here"));
    }
    if count == 0 {
        wrong.push(format!("the box says that it has no parameters, and sends {}", shown(&first.name)));
        return Ok((vec![first], wrong));
    }
    let mut values: BTreeMap<u16, Param> = BTreeMap::new();
    let mut next = Some(first);
    while let Some(value) = next {
        if value.count != said && wrong.is_empty() {
            wrong.push(format!("the box says that it has {said} parameters, and {}", value.count));
        }
        // Without a place: another program's request by name.
        if value.index < count {
            let (index, name) = (value.index, shown(&value.name));
            let before = values.insert(index, value).map(|before| shown(&before.name));
            if let Some(before) = before.filter(|before| *before != name) {
                wrong.push(format!("parameter {index} has two names: {before} and {name}"));
            }
        }
        if values.len() == usize::from(count) {
            break;
        }
        next = client.until(Instant::now() + GAP, value_of)?;
    }
    for index in 0..count {
        if values.contains_key(&index) {
            continue;
        }
        let packet = Packet::new(PARAM_REQUEST_READ).u16(0, index).u8(2, system).u8(3, component);
        let wanted = |frame: &Frame<'_>| value_of(frame).filter(|value| value.index == index);
        let value = client.ask(&packet, ANSWER, TRIES, wanted)?;
        values.insert(
            index,
            value.with_context(|| {
                format!("system {system}: parameter {index} of {count}: no answer; check the link")
            })?,
        );
    }
    wrong.extend(strange_names(&values));
    Ok((values.into_values().collect(), wrong))
}

fn strange_names(values: &BTreeMap<u16, Param>) -> Vec<String> {
    let mut wrong = Vec::new();
    let mut places: BTreeMap<&str, u16> = BTreeMap::new();
    for (index, Param { name, .. }) in values {
        if name.is_empty() || !name.chars().all(is_of_names) {
            wrong.push(format!("parameter {index} has a name that is none: {}", shown(name)));
        }
        if let Some(before) = places.insert(name, *index) {
            wrong.push(format!("parameters {before} and {index} have one name: {}", shown(name)));
        }
    }
    wrong
}

#[cfg(test)]
mod tests {
    use hums_link::messages::param_value;

    use super::*;
    use crate::talk::tests::fake;

    #[test]
    fn what_another_systems_board_says_is_no_answer() {
        let mut client = fake::found(&[2, 1], |frame| {
            let said = |system, value| (system, param_value("GS_BUDGET", value, 0, 1));
            if [PARAM_REQUEST_READ, PARAM_REQUEST_LIST].contains(&frame.id()) {
                vec![said(2, 7.0), said(1, 2000.0)]
            } else {
                Vec::new()
            }
        });
        let value = read(&mut client, "GS_BUDGET").expect("an answer").value;
        assert_eq!(value.to_bits(), 2000_f32.to_bits());
        let values: Vec<f32> =
            list(&mut client).expect("a list").0.into_iter().map(|param| param.value).collect();
        assert_eq!(values, [2000.0]);
    }

    #[test]
    fn an_earlier_answer_is_not_that_to_a_set() {
        for (stale, refuses, kept) in [(2, false, 7.0), (1, true, 5.0)] {
            let mut client = fake::found(&[1], move |frame| {
                let mut said = vec![(1, param_value("A", 5.0, 0, 1)); stale];
                said.extend((!refuses).then(|| (1, param_value("A", 7.0, 0, 1))));
                if frame.id() == PARAM_SET { said } else { Vec::new() }
            });
            let value = set(&mut client, "A", 7.0, REAL32).expect("an answer").value;
            assert_eq!(value.to_bits(), f32::to_bits(kept));
        }
    }

    #[test]
    fn a_list_that_cannot_be_is_told_and_no_name_makes_a_line_of_its_own() {
        let listed = |said: fn() -> fake::Answers| {
            let mut client = fake::found(&[1], move |_| said());
            let (values, wrong) = list(&mut client).expect("a list");
            (values.iter().map(|value| shown(&value.name)).collect::<Vec<_>>(), wrong)
        };
        let (names, wrong) =
            listed(|| vec![(1, param_value("A_1", 1.0, 0, 2)), (1, param_value("B", 1.0, 1, 2))]);
        assert_eq!((names, wrong), (vec!["A_1".to_owned(), "B".to_owned()], Vec::new()));
        let (names, wrong) =
            listed(|| vec![(1, param_value("A", 1.0, 0, 2)), (1, param_value("A", 2.0, 1, 2))]);
        assert_eq!((names.len(), &wrong[..]), (2, &["parameters 0 and 1 have one name: A".to_owned()][..]));
        let (_, wrong) = listed(|| {
            [("A", 0), ("B", 0), ("C", 1)].map(|(name, at)| (1, param_value(name, 1.0, at, 2))).to_vec()
        });
        assert_eq!(wrong, ["parameter 0 has two names: A and B"]);
        let (names, wrong) = listed(|| vec![(1, param_value("A", 1.0, 0, 0))]);
        assert!(names == ["A"] && wrong[0].contains("has no parameters"), "{wrong:?}");
        let (_, wrong) = listed(|| vec![(1, param_value("A", 1.0, 0, 2)), (1, param_value("B", 1.0, 1, 3))]);
        assert!(wrong[0].contains("has 2 parameters, and 3"), "{wrong:?}");
        let (names, wrong) = listed(|| {
            let names = ["A\nB 5", "#x", "system", "", "A B"];
            (0..).zip(names).map(|(index, name)| (1, param_value(name, 1.0, index, 5))).collect()
        });
        assert!(names.iter().all(|name| !name.contains(['\n', ' ', '#']) && !name.is_empty()), "{names:?}");
        assert!(wrong.len() == 5 && !names.contains(&"system".to_owned()), "{wrong:?}");
    }

    #[test]
    fn a_number_that_a_parameter_cannot_have_is_told() {
        for (wanted, kept, is_rounded) in [
            (16_777_217.0, 16_777_216.0, true),
            (16_777_216.0, 16_777_216.0, false),
            (21.3, 21.3, false),
            (-0.1, -0.1, false),
            (0.123_456_789_1, 0.123_456_79, true),
            (1e-60, 0.0, true),
        ] {
            let (value, told) = single(wanted).expect("a number");
            assert_eq!((value.to_bits(), told), (f32::to_bits(kept), is_rounded), "{wanted}");
        }
        assert!(single(1e39).expect_err("too much").is::<crate::outcome::Usage>());
        assert!(!single(f64::NAN).expect("for the box to refuse").1);
    }
}
