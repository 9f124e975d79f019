//! `hums box format-card`.

use std::time::{Duration, Instant};

use anyhow::{Context as _, Result, bail};
use hums_core::observation::CommandAck;
use hums_link::Frame;
use hums_link::mav_cmd::STORAGE_FORMAT;
use hums_link::packet::Fields;
use serde::Serialize;

use super::{Client, accepted, result_of};
use crate::cli;
use crate::mavlink::ids::STATUSTEXT;
use crate::outcome::{Outcome, usage};
use crate::output::{self, Schema};

const ANSWER: Duration = Duration::from_millis(700);
const TRIES: usize = 8;
/// 512 GB take two minutes, 1 TB four.
const LIMIT: Duration = Duration::from_mins(5);
/// Silence of any message: the box is gone.
const SILENCE: Duration = Duration::from_secs(15);

const SCHEMA: Schema = Schema::first("hums-format");

#[derive(Debug, Serialize)]
struct FormattedJson {
    /// MAVLink system id of the box's vehicle.
    system: u8,
    /// True; a failure gives exit code 1.
    formatted: bool,
}

/// Runs `hums box format-card`.
pub fn run(args: &cli::FormatCard) -> Result<Outcome> {
    if !args.yes {
        return Err(usage("this erases all files on the box's card; add --yes to confirm"));
    }
    let mut client = Client::connect_alone(&args.at)?;
    let system = client.system();
    format(&mut client, SILENCE, LIMIT).with_context(|| format!("system {system}"))?;
    if args.at.json {
        output::json(SCHEMA, &FormattedJson { system, formatted: true })?;
    } else {
        output::line(&format!("system {system}: formatted, and recorded on"))?;
    }
    Ok(Outcome::Done)
}

enum Answer {
    /// A `MAV_RESULT`.
    Result(u8),
    Card(String),
}

impl Answer {
    fn read(frame: &Frame<'_>) -> Option<Self> {
        let state = || {
            let text = Fields(frame.payload()).text(1, 50).filter(|_| frame.id() == STATUSTEXT);
            text?.strip_prefix("HUMS: card: ").map(str::to_owned)
        };
        result_of(frame, STORAGE_FORMAT).map(Self::Result).or_else(|| state().map(Self::Card))
    }
}

fn format(client: &mut Client, silence: Duration, limit: Duration) -> Result<()> {
    let system = client.system();
    let answer = client.command(STORAGE_FORMAT, &[1.0, 1.0], ANSWER, TRIES)?;
    let mut result = answer.context("no answer; check the link, or flash the firmware of this version")?;
    check(result)?;
    let minutes = LIMIT.as_secs() / 60;
    output::aside(&format!(
        "system {system}: the card is being formatted, which may take some minutes ({minutes} at most)"
    ));
    let end = Instant::now() + limit;
    loop {
        // Any frame proves its presence.
        match client.until(end.min(Instant::now() + silence), |frame| Some(Answer::read(frame)))? {
            // After the acceptance: of the repeated command.
            Some(Some(Answer::Result(next))) if result == CommandAck::IN_PROGRESS => {
                check(next)?;
                result = next;
            }
            Some(Some(Answer::Card(state))) if state == "recording" => return Ok(()),
            Some(Some(Answer::Card(state))) if !state.starts_with("is being") => {
                bail!("the card was not formatted; the box reports: {state}")
            }
            Some(_) => {}
            None if Instant::now() < end => bail!(
                "the box has sent nothing for {} s, so the result is not known; check its power, and try again",
                silence.as_secs()
            ),
            None => bail!(
                "no result within {minutes} minutes; send the command again (a card that is ready is refused)"
            ),
        }
    }
}

fn check(result: u8) -> Result<()> {
    match result {
        CommandAck::UNSUPPORTED => {
            bail!("the firmware does not know the command; flash the one of this version")
        }
        CommandAck::FAILED => bail!("there is no card to format; insert one"),
        result => accepted(
            result,
            "its card works, is full of other files, or GS_SIGN needs a signed command; format such a card on a PC, or give --key FILE",
        ),
    }
}

#[cfg(test)]
mod tests {
    use hums_link::messages::{command_ack, status_text};
    use hums_link::statustext::Severity;

    use super::*;
    use crate::talk::tests::fake::{self, found};

    fn end(silence_ms: u64, limit_ms: u64, said: fn() -> fake::Answers) -> Result<()> {
        let mut client = found(&[1], move |_| said());
        format(&mut client, Duration::from_millis(silence_ms), Duration::from_millis(limit_ms))
    }

    fn ack(result: u8, station: u8) -> (u8, hums_link::packet::Packet) {
        (1, command_ack(STORAGE_FORMAT, result, station, 190))
    }

    fn recording(system: u8) -> (u8, hums_link::packet::Packet) {
        (system, status_text(Severity::Info, "HUMS: card: recording"))
    }

    #[test]
    fn an_answer_to_another_station_is_none_to_us() {
        let refused = end(5_000, 5_000, || vec![ack(0, 77), ack(2, 255), recording(1)]);
        assert!(refused.expect_err("it was refused").to_string().contains("the box refused"));
    }

    #[test]
    fn what_is_in_progress_has_not_failed_and_may_fail_yet() {
        end(5_000, 5_000, || vec![ack(5, 255), ack(5, 255), ack(0, 255), recording(1)]).expect("done");
        let failed = end(5_000, 5_000, || vec![ack(5, 255), ack(4, 255), recording(1)]);
        assert!(failed.expect_err("it failed").to_string().contains("there is no card to format"));
        // The second answer came during formatting.
        end(5_000, 5_000, || vec![ack(0, 255), ack(2, 255), recording(1)]).expect("done");
    }

    #[test]
    fn a_board_that_never_says_how_its_card_is_is_not_waited_for_without_end() {
        let never = end(5_000, 50, || vec![ack(0, 255), recording(2)]);
        assert!(never.expect_err("no word").to_string().contains("no result within"));
        let silent = end(50, 5_000, || vec![ack(0, 255)]);
        assert!(silent.expect_err("no word").to_string().contains("check its power"));
    }
}
