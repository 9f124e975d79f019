//! `hums box setup`: the wiring of a board, the autopilot's settings for it, and a bench check.
//!
//! The autopilot answers over its own link, or through the box while `GS_PASS` is 1. The bench check reads the log that the
//! box records now: messages and rates are those that the box received.

mod bench;
mod settings;

use std::time::{Duration, Instant};

use anyhow::{Context as _, Result};
use hums_boards::{Board, Wire};
use hums_core::parameters::Param as BoxParam;
use hums_link::encode::COMPONENT;
use hums_link::packet::Fields;
use serde::Serialize;

use self::settings::Setting;
use super::{Client, LISTEN, params};
use crate::cli;
use crate::colour::level;
use crate::duplex::Duplex;
use crate::mavlink::ids::HEARTBEAT;
use crate::outcome::{Outcome, usage};
use crate::output::{self, Schema};
use crate::printable::word;
use crate::table::{Table, left};

const SCHEMA: Schema = Schema::first("hums-setup");
/// `MAV_COMP_ID_AUTOPILOT1`
const AUTOPILOT: u8 = 1;
/// `MAV_AUTOPILOT_ARDUPILOTMEGA`, `MAV_AUTOPILOT_PX4`
const ARDUPILOT: u8 = 3;
const PX4: u8 = 12;
/// `MAV_MODE_FLAG_SAFETY_ARMED`
const ARMED: u8 = 0x80;
/// Three heartbeats.
const HEARTBEATS: Duration = Duration::from_secs(3);
const TRIES: usize = 3;
const HEARD: [u8; 2] = [COMPONENT, AUTOPILOT];
/// What to check if the box is not heard.
const SILENT: &str =
    "no message of the box: check its LED, its supply, the wires to the autopilot, and the port's rate";

/// The result.
#[derive(Debug, Serialize)]
pub struct SetupJson {
    /// MAVLink system id of the box's vehicle.
    system: u8,
    /// Of the board of `--board`, else of the image's.
    wiring: Vec<Wiring>,
    /// Parameters of the autopilot; empty if it is not heard on the link.
    settings: Vec<Setting>,
    /// The bench check.
    checks: Vec<CheckLine>,
    /// No check is `missing`.
    ready: bool,
}

impl SetupJson {
    /// On an open link.
    pub fn on(duplex: Duplex, args: &cli::Setup) -> Result<Self> {
        let listen = if args.at.system.is_some() { Duration::ZERO } else { LISTEN };
        check(Client::over(duplex, None).found(&args.at, &HEARD, listen).context(SILENT)?, args, None)
    }

    /// The last line.
    pub fn verdict(&self) -> String {
        let names = |state| {
            let checks = self.checks.iter().filter(|check| check.state == state).map(|check| check.check);
            checks.collect::<Vec<_>>().join(", ")
        };
        match (self.ready, names("unknown")) {
            (false, _) => format!("not ready: {}", names("missing")),
            (true, unknown) if unknown.is_empty() => "ready to fly".to_owned(),
            (true, unknown) => format!("ready to fly, but not known: {unknown}"),
        }
    }
}

/// A wire or a part of the board.
#[derive(Debug, Serialize)]
struct Wiring {
    /// The other end of the wire.
    wire: &'static str,
    /// Pad and pin of the board.
    pad: String,
}

#[derive(Debug, Serialize)]
struct CheckLine {
    /// `box`, `settings`, `image`, `card`, `clock`, `messages`, `checks`.
    check: &'static str,
    /// `ok`, `missing`, `unknown`.
    state: &'static str,
    /// The reason, as a sentence.
    detail: String,
}

fn line(check: &'static str, is_ok: bool, detail: impl Into<String>) -> CheckLine {
    CheckLine { check, state: if is_ok { "ok" } else { "missing" }, detail: detail.into() }
}

/// Parameters of the box.
struct BoxSettings {
    baud: u32,
    path: u8,
    has_streams: bool,
}

impl BoxSettings {
    /// `value` gives that of a parameter.
    fn of(mut value: impl FnMut(BoxParam) -> Result<f32>) -> Result<Self> {
        Ok(Self {
            baud: value(BoxParam::ApBaud)? as u32,
            path: value(BoxParam::GsPath)? as u8,
            has_streams: value(BoxParam::ApStreams)? > 0.0,
        })
    }
}

/// The autopilot on the link.
#[derive(Clone, Copy)]
struct HeardAutopilot {
    autopilot: u8,
    is_armed: bool,
}

/// Runs `hums box setup`.
pub fn run(args: &cli::Setup) -> Result<Outcome> {
    let board = args.board.as_deref().map(|name| hums_boards::find(name).map_err(usage)).transpose()?;
    if let Some(board) = board.filter(|_| !args.at.json) {
        output::line(&format!("wiring of {}, all grounds together, 3.3 V signals", board.title))?;
        let mut table = Table::new(2, [left(0), left(0)]);
        for Wiring { wire, pad } in wiring(board) {
            table.row([wire.to_owned(), pad]);
        }
        output::line(&table.text())?;
        board.owner.notes.iter().try_for_each(|note| output::line(&format!("  {note}")))?;
    }
    if let Some(file) = &args.restore {
        let values = settings::values_of(file)?;
        return settings::restore(&mut Client::connect_to(&args.at, &[AUTOPILOT])?, &values);
    }
    let found = check(Client::connect_to(&args.at, &HEARD).context(SILENT)?, args, board)?;
    if args.at.json {
        output::json(SCHEMA, &found)?;
    } else {
        let mut table = Table::new(2, [left(7), left(0), left(0)]);
        for CheckLine { check, state, detail } in &found.checks {
            let state = level(if *state == "missing" { "MISSING" } else { state }).to_string();
            table.row([state, (*check).to_owned(), word(detail).into_owned()]);
        }
        output::line(&format!("bench check\n{}\n{}", table.text(), found.verdict()))?;
    }
    Ok(if found.ready { Outcome::Done } else { Outcome::Findings })
}

fn check(mut client: Client, args: &cli::Setup, mut board: Option<&'static Board>) -> Result<SetupJson> {
    let (system, found) = client.target();
    let is_silent = found != COMPONENT;
    let own = BoxSettings::of(|param| {
        let spec = param.spec();
        if is_silent { Ok(spec.default) } else { params::value(&mut client, spec.name) }
    })?;
    client.turn_to(AUTOPILOT);
    let heard = autopilot(&mut client)?;
    let wanted = |heard: HeardAutopilot| settings::wanted(&mut client, heard.autopilot, args.port, &own);
    let mut settings = heard.map_or_else(|| Ok(Vec::new()), wanted)?;
    if let Some(file) = &args.undo {
        settings::change(&mut client, &mut settings, file)?;
    }
    if !args.at.json {
        settings::show(heard, &settings)?;
    }
    client.turn_to(COMPONENT);
    let mut checks = vec![bench::own(&own, &args.at.link.to_string()), settings::check(&settings)];
    if is_silent {
        let detail = format!("{SILENT}; the settings are for {} baud, its AP_BAUD as delivered", own.baud);
        checks[0] = line("box", false, detail);
    } else {
        let ready = bench::prearm(&mut client)?;
        checks.extend(bench::recorded(client, &own, &mut board, heard)?);
        checks.push(ready);
    }
    let ready = checks.iter().all(|check| check.state != "missing");
    Ok(SetupJson { system, wiring: board.map_or_else(Vec::new, wiring), settings, checks, ready })
}

fn wiring(board: &Board) -> Vec<Wiring> {
    let pad = |wire: &Wire| format!("{} ({})", wire.pad, wire.pin);
    let Board { autopilot, radio, card, led, owner, .. } = board;
    let all = [
        ("autopilot's TX", pad(&autopilot.rx)),
        ("autopilot's RX", pad(&autopilot.tx)),
        ("radio's TX", pad(&radio.rx)),
        ("radio's RX", pad(&radio.tx)),
        ("card", card.slot.clone()),
        ("LED", format!("{}, lit when {}; it blinks slowly while it records", led.pin, led.lit.name())),
        ("power", owner.power.clone()),
    ];
    all.into_iter().map(|(wire, pad)| Wiring { wire, pad }).collect()
}

fn autopilot(client: &mut Client) -> Result<Option<HeardAutopilot>> {
    client.until(Instant::now() + HEARTBEATS, |frame| {
        let fields = Fields(frame.payload());
        let heard = HeardAutopilot { autopilot: fields.u8(5), is_armed: fields.u8(6) & ARMED != 0 };
        (frame.id() == HEARTBEAT).then_some(heard)
    })
}
