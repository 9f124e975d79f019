//! `hums params`: the board's parameters, as ground stations ask for them.

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
use crate::talk;

/// A silence of this long in a list means that what is missing was lost.
const GAP: Duration = Duration::from_millis(1_500);
const ANSWER: Duration = Duration::from_millis(700);
const TRIES: usize = 8;
/// More parameters than a board has.
const COUNT_MAX: u16 = 4_096;

/// `PARAM_VALUE`
struct Param {
    name: String,
    value: f32,
    index: u16,
    count: u16,
}

/// Runs `hums params`.
pub fn run(args: &cli::Params) -> Result<Outcome> {
    match &args.action {
        ParamsAction::List { at, json } => {
            let mut client = Client::connect(at)?;
            show(client.system(), list(&mut client)?, *json)?;
        }
        ParamsAction::Get { names, at, json } => {
            let mut client = Client::connect(at)?;
            let system = client.system();
            let values = names.iter().map(|name| read(&mut client, name));
            if *json {
                show(system, values.collect::<Result<Vec<_>>>()?, true)?;
            } else {
                // Each as it comes: a later one may not be there.
                values.into_iter().try_for_each(|value| show(system, [value?], false))?;
            }
        }
        ParamsAction::Sign { at, remove, json } => {
            let system = sign(at, *remove)?;
            if *json {
                output::json(SIGNED, &KeyJson { system, has_key: !*remove })?;
            } else {
                output::line(if *remove { "key removed" } else { "key set" })?;
            }
        }
        ParamsAction::Set { name, value, at, json } => {
            let mut client = Client::connect(at)?;
            let (system, component) = client.target();
            let packet = Packet::new(PARAM_SET)
                .f32(0, *value)
                .u8(4, system)
                .u8(5, component)
                .text(6, 16, name)
                .u8(22, 9);
            let kept = client
                .ask(&packet, ANSWER, TRIES, |frame| value_of(frame).filter(|value| value.name == *name))?
                .with_context(|| no_answer(system, name))?;
            if kept.value.to_bits() != value.to_bits() {
                bail!("system {system}: {name}: the board refused {value} and keeps {}", kept.value);
            }
            show(system, [kept], *json)?;
        }
    }
    Ok(Outcome::Done)
}

/// What `hums params list`, `get` and `set` print with `--json`.
const VALUES: Schema = Schema::first("hums-params");
/// What `hums params sign --json` prints.
const SIGNED: Schema = Schema::first("hums-params-sign");

/// What the board said of its key.
#[derive(Debug, Serialize)]
struct KeyJson {
    system: u8,
    has_key: bool,
}

/// Prints parameters, as lines that `hums sim --params` reads back, or as one object.
fn show(system: u8, values: impl IntoIterator<Item = Param>, json: bool) -> Result<()> {
    if json {
        let values = values.into_iter().map(|value| (value.name, f64::from(value.value).into()));
        let object: serde_json::Map<_, _> =
            std::iter::once(("system".to_owned(), system.into())).chain(values).collect();
        return output::json(VALUES, &object);
    }
    values.into_iter().try_for_each(|value| output::line(&format!("{} {}", value.name, value.value)))
}

/// Brings the board the key, or takes it away; gives its system. The board answers with a text.
fn sign(at: &Link, remove: bool) -> Result<u8> {
    let path = at.key.as_deref();
    let key = match path {
        Some(path) => talk::key(path)?,
        None if remove => Key([0; KEY_BYTES]),
        None => return Err(usage("params sign: which key? --key FILE")),
    };
    // Unsigned: the board does not know the key yet, and does not ask over the port that it trusts.
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
            "system {system}: the board does not take the key: does its SIGN_PORT trust this port? See docs/companion.md"
        )
    })?;
    Ok(system)
}

fn no_answer(system: u8, name: &str) -> String {
    format!("system {system}: {name}: no answer; is there such a parameter?")
}

fn value_of(frame: &Frame<'_>) -> Option<Param> {
    let fields = Fields(frame.payload());
    (frame.id() == PARAM_VALUE).then(|| Param {
        name: fields.text(8, 16).unwrap_or_default().to_owned(),
        value: fields.f32(0),
        index: fields.u16(6),
        count: fields.u16(4),
    })
}

fn read(client: &mut Client, name: &str) -> Result<Param> {
    let (system, component) = client.target();
    let packet =
        Packet::new(PARAM_REQUEST_READ).u16(0, u16::MAX).u8(2, system).u8(3, component).text(4, 16, name);
    let answer =
        client.ask(&packet, ANSWER, TRIES, |frame| value_of(frame).filter(|value| value.name == name))?;
    answer.with_context(|| no_answer(system, name))
}

/// The whole list; what was lost on the way is asked for one by one.
fn list(client: &mut Client) -> Result<Vec<Param>> {
    let (system, component) = client.target();
    let request = Packet::new(PARAM_REQUEST_LIST).u8(0, system).u8(1, component);
    let mut values: BTreeMap<u16, Param> = BTreeMap::new();
    let first = client
        .ask(&request, GAP, TRIES, value_of)?
        .with_context(|| format!("system {system}: no list of parameters comes"))?;
    let count = first.count.min(COUNT_MAX);
    values.insert(first.index, first);
    while values.len() < usize::from(count) {
        match client.until(Instant::now() + GAP, value_of)? {
            Some(value) => {
                values.insert(value.index, value);
            }
            None => break,
        }
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
            value.with_context(|| format!("system {system}: parameter {index} of {count}: no answer"))?,
        );
    }
    Ok(values.into_values().collect())
}

#[cfg(test)]
mod tests {
    use hums_link::messages::param_value;

    use super::*;
    use crate::talk::fake;

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
        assert_eq!(read(&mut client, "GS_BUDGET").expect("an answer").value, 2000.0);
        let values: Vec<f32> =
            list(&mut client).expect("a list").into_iter().map(|param| param.value).collect();
        assert_eq!(values, [2000.0]);
    }
}
