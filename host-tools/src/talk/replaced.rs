//! `hums box replaced`, over a link or by a file on the card: the box counts the new part.

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context as _, Result, bail};
use hums_core::component::{COMPONENTS_MAX, ComponentKind, LABEL_BYTES};
use hums_link::mav_cmd::USER_1_REPLACED;
use hums_link::param_line::{self, Line};
use serde::Serialize;

use super::{Client, accepted, of_newest, params};
use crate::cli::{self, Link};
use crate::files::{Inputs, Output, settle};
use crate::outcome::{Outcome, usage};
use crate::output::{self, Schema};
use crate::part;
use crate::summary::Contents;

const ANSWER: Duration = Duration::from_secs(2);
/// Tries: with a serial number a repeated command replaces the part once.
const TRIES: usize = 3;
/// The file in a card's root, read at each power-on.
const SETTINGS: &str = "PARAMS.TXT";
/// Single precision holds 24 bits exactly.
const CHARACTERS: usize = 3;

const SCHEMA: Schema = Schema::first("hums-replaced");

#[derive(Debug, Serialize)]
struct ReplacedJson {
    /// Component, from 1.
    place: usize,
    part: String,
    serial: String,
    /// `null` over a link.
    file: Option<PathBuf>,
}

/// Runs `hums box replaced`.
pub fn run(args: &cli::Replaced) -> Result<Outcome> {
    let serial = args.serial.as_deref().unwrap_or_default();
    let is_plain = |c: char| c.is_ascii_graphic() && !matches!(c, '#' | ',' | '<');
    if serial.len() > LABEL_BYTES || !serial.chars().all(is_plain) {
        return Err(usage(format!(
            "--serial {serial}: a serial number has at most {LABEL_BYTES} letters, digits and signs, without spaces, `#`, `,` and `<`"
        )));
    }
    let part = part::name(args.part.name(), args.number, "");
    let (place, file) = match (&args.card, &args.link) {
        (Some(card), _) => {
            let (place, old) = on_card(card, args.part, args.number)?;
            (place, Some(write(card, place, serial, &old)?))
        }
        (None, Some(link)) => {
            let (link, key) = (link.clone(), args.key.clone());
            let at = Link { link, key, system: args.system, json: args.json };
            let mut client = Client::connect_alone(&at)?;
            let place = on_board(&mut client, args.part, args.number)?;
            tell(&mut client, place, serial)?;
            (place, None)
        }
        (None, None) => return Err(usage("no box is given; add --link SRC, or --card DIR of its card")),
    };
    if args.json {
        output::json(SCHEMA, &ReplacedJson { place, part, serial: serial.to_owned(), file })?;
    } else {
        let when = file.map_or_else(
            || "replaced; the box counts from zero".to_owned(),
            |file| format!("{} says so to the box, which replaces it at its next start", file.display()),
        );
        output::line(&format!("component {place}, {part}: {when}"))?;
    }
    Ok(Outcome::Done)
}

fn place_of(
    known: impl IntoIterator<Item = (usize, ComponentKind, u8)>,
    part: ComponentKind,
    number: u8,
) -> Result<usize> {
    let known: Vec<_> = known.into_iter().filter(|(_, kind, _)| *kind != ComponentKind::None).collect();
    let mut mine = known.iter().filter(|(_, kind, of)| *kind == part && *of == number);
    match (mine.next(), mine.next()) {
        (Some((place, ..)), None) => Ok(*place),
        (Some((one, ..)), Some((other, ..))) => bail!(
            "components {one} and {other} are both {}: give them different CMPn_NUMBER",
            part::name(part.name(), number, "")
        ),
        (None, _) => {
            let names = known.iter().map(|(_, kind, number)| part::name(kind.name(), *number, ""));
            let names = names.collect::<Vec<_>>().join(", ");
            let there = if names.is_empty() { "no part".to_owned() } else { names };
            Err(usage(format!(
                "the box has no component {}; it has {there} (CMPn_KIND, CMPn_NUMBER)",
                part::name(part.name(), number, "")
            )))
        }
    }
}

fn on_board(client: &mut Client, part: ComponentKind, number: u8) -> Result<usize> {
    let mut known = Vec::new();
    for place in 1..=COMPONENTS_MAX {
        let kind = params::value(client, &format!("CMP{place}_KIND"))?;
        let number = params::value(client, &format!("CMP{place}_NUMBER"))?;
        known.push((place, ComponentKind::from_number(kind as u8).unwrap_or_default(), number as u8));
    }
    place_of(known, part, number)
}

fn tell(client: &mut Client, place: usize, serial: &str) -> Result<()> {
    let number = |characters: &[u8]| {
        let mut number = [0; 4];
        number.iter_mut().skip(1).zip(characters).for_each(|(to, from)| *to = *from);
        u32::from_be_bytes(number) as f32
    };
    let mut values = vec![place as f32];
    values.extend(serial.as_bytes().chunks(CHARACTERS).map(number));
    let answer = client.command(USER_1_REPLACED, &values, ANSWER, TRIES)?;
    let answer = answer.context("no answer; check the link, or flash the firmware of this version");
    let denied = "there is no such component, or GS_SIGN needs a signed command; give --key FILE";
    answer.and_then(|result| accepted(result, denied)).with_context(|| format!("system {}", client.system()))
}

fn on_card(card: &Path, part: ComponentKind, number: u8) -> Result<(usize, String)> {
    let components = |contents: Contents| Some(contents.components).filter(|all| !all.is_empty());
    let components = of_newest(card, components)?.with_context(|| {
        format!("{}: no log on it has components; set CMPn_KIND first (docs/usage.md)", card.display())
    })?;
    let kind =
        |name: &str| ComponentKind::ALL.into_iter().find(|kind| kind.name() == name).unwrap_or_default();
    let known = components.iter().map(|(place, line)| (usize::from(*place), kind(line.kind), line.number));
    let place = place_of(known, part, number)?;
    Ok((place, components.get(&(place as u8)).map_or_else(String::new, |line| line.serial.clone())))
}

fn write(card: &Path, place: usize, serial: &str, old: &str) -> Result<PathBuf> {
    if serial.is_empty() {
        return Err(usage("--serial is missing: on a card, the box knows a new part by its serial number"));
    }
    let (path, name) = (card.join(SETTINGS), format!("CMP{place}_SERIAL"));
    let before = if path.exists() { settle(fs::read_to_string(&path), &path)? } else { String::new() };
    let is_other = |line: &&str| !matches!(param_line::read(line), Line::Set(of, _) if of == name);
    let mut text = format!("{name} {serial}<{old}\n");
    before.lines().filter(is_other).for_each(|line| text.extend([line, "\n"]));
    let mut file = Output::create(&path, &Inputs::none().forcing(true))?;
    settle(file.write_all(text.as_bytes()), &path)?;
    file.finish()?;
    Ok(path)
}

#[cfg(test)]
mod tests {
    use hums_link::messages::command_ack;
    use hums_link::packet::{Fields, Packet};

    use super::*;
    use crate::mavlink::ids::{PARAM_REQUEST_READ, PARAM_VALUE};
    use crate::talk::tests::fake::found;

    #[test]
    fn the_board_is_told_the_place_of_the_part_and_its_serial_number() {
        let kinds = [1.0, 3.0, 3.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let numbers = [0.0, 1.0, 3.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let mut client = found(&[1], move |frame| {
            let fields = Fields(frame.payload());
            if frame.id() == 76 {
                // Component 3; "A-4" and "711" in 24 bits.
                let told = [0, 4, 8, 12].map(|at| fields.f32(at) as u32);
                let is_it = told == [3, 4_271_412, 3_617_073, 0];
                return vec![(1, command_ack(USER_1_REPLACED, if is_it { 0 } else { 3 }, 255, 190))];
            }
            let name = fields.text(4, 16).filter(|_| frame.id() == PARAM_REQUEST_READ);
            let Some(name) = name else { return Vec::new() };
            let place = usize::from(name.as_bytes()[3] - b'1');
            let value = if name.ends_with("KIND") { kinds[place] } else { numbers[place] };
            vec![(1, Packet::new(PARAM_VALUE).f32(0, value).u16(4, 16).text(8, 16, name))]
        });
        let place = on_board(&mut client, ComponentKind::Motor, 3).expect("it is there");
        assert_eq!(place, 3);
        tell(&mut client, place, "A-4711").expect("accepted");
        let refused = on_board(&mut client, ComponentKind::Motor, 2).expect_err("no such part").to_string();
        assert!(
            refused.contains("no component motor 2") && refused.contains("airframe, motor 1, motor 3"),
            "{refused}"
        );
    }

    #[test]
    fn the_settings_of_a_card_keep_their_other_lines() {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join(SETTINGS);
        fs::write(&path, "GS_BUDGET 1000\nCMP2_SERIAL old\n").expect("written");
        write(dir.path(), 2, "new-7", "old").expect("written");
        assert_eq!(fs::read_to_string(&path).expect("there"), "CMP2_SERIAL new-7<old\nGS_BUDGET 1000\n");
    }
}
