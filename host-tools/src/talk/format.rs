//! `hums format`: the board formats a card that it cannot record on.

use std::time::{Duration, Instant};

use anyhow::{Context as _, Result, bail};
use hums_link::messages;
use hums_link::packet::Fields;
use serde::Serialize;

use super::Client;
use crate::cli;
use crate::mavlink::ids::{COMMAND_ACK, STATUSTEXT};
use crate::outcome::{Outcome, usage};
use crate::output::{self, Schema};

/// `MAV_CMD_STORAGE_FORMAT`
const FORMAT: u16 = 526;
const ANSWER: Duration = Duration::from_millis(700);
const TRIES: usize = 8;
/// A card of 512 GB takes two minutes.
const PATIENCE: Duration = Duration::from_mins(10);

/// What `hums format --json` prints.
const SCHEMA: Schema = Schema::first("hums-format");

#[derive(Debug, Serialize)]
struct FormattedJson {
    system: u8,
    formatted: bool,
}

/// Runs `hums format`.
pub fn run(args: &cli::FormatCard) -> Result<Outcome> {
    if !args.yes {
        return Err(usage("everything on the board's card will be lost; say --yes if that is meant"));
    }
    let mut client = Client::connect(&args.at)?;
    let (system, component) = client.target();
    let packet = messages::command_long(FORMAT, &[1.0, 1.0], system, component);
    let answer = client.ask(&packet, ANSWER, TRIES, |frame| {
        let fields = Fields(frame.payload());
        (frame.id() == COMMAND_ACK && fields.u16(0) == FORMAT).then(|| fields.u8(2))
    })?;
    match answer.context("no answer; is its firmware as new as this program?")? {
        0 => {}
        1 => bail!("not now: the vehicle is armed"),
        2 => bail!(
            "the board refused: its card can be recorded on, or is full of other files, and is not formatted over \
             a link; or the command is not signed as GS_SIGN asks"
        ),
        _ => bail!("there is no card that can be formatted"),
    }
    output::aside("the card is being formatted");
    let end = Instant::now() + PATIENCE;
    let told = client.until(end, |frame| {
        let text = Fields(frame.payload()).text(1, 50).filter(|_| frame.id() == STATUSTEXT)?;
        let state = text.strip_prefix("HUMS: card: ")?;
        (!state.starts_with("is being")).then(|| state.to_owned())
    })?;
    match told.as_deref() {
        Some("recording") => {
            if args.json {
                output::json(SCHEMA, &FormattedJson { system, formatted: true })?;
            } else {
                output::line(&format!("system {system}: formatted, and recorded on"))?;
            }
            Ok(Outcome::Done)
        }
        Some(state) => bail!("it did not work, the board says of its card: {state}"),
        None => bail!("the board does not say that it is done"),
    }
}
