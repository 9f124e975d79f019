//! `hums box card-reader`: the box restarts as a USB card reader.

use std::time::Duration;

use anyhow::{Context as _, Result, bail};
use hums_core::observation::CommandAck;
use hums_link::mav_cmd::{PREFLIGHT_REBOOT_SHUTDOWN, REBOOT_TO_MASS_STORAGE};
use serde::Serialize;

use super::{Client, accepted};
use crate::cli;
use crate::outcome::Outcome;
use crate::output::{self, Schema};

const MASS_STORAGE: f32 = REBOOT_TO_MASS_STORAGE as f32;
const ANSWER: Duration = Duration::from_millis(400);
/// The box restarts half a second after its answer, which may be lost.
const TRIES: usize = 3;

const SCHEMA: Schema = Schema::first("hums-card-reader");

#[derive(Debug, Serialize)]
struct CardReaderJson {
    /// MAVLink system id of the box's vehicle.
    system: u8,
    /// True; a refusal gives exit code 1.
    restarts: bool,
}

/// Runs `hums box card-reader`.
pub fn run(args: &cli::CardReader) -> Result<Outcome> {
    let mut client = Client::connect_alone(&args.at)?;
    let system = client.system();
    tell(&mut client).with_context(|| format!("system {system}"))?;
    if args.at.json {
        output::json(SCHEMA, &CardReaderJson { system, restarts: true })?;
    } else {
        output::line(&format!(
            "system {system}: restarts as a card reader and records nothing until the disk is ejected, power is switched, or no PC \
             was there for 10 minutes"
        ))?;
    }
    Ok(Outcome::Done)
}

fn tell(client: &mut Client) -> Result<()> {
    let answer = client.command(PREFLIGHT_REBOOT_SHUTDOWN, &[MASS_STORAGE], ANSWER, TRIES)?;
    match answer.context("no answer; if the PC has no new disk, send the command again")? {
        CommandAck::UNSUPPORTED => bail!("the firmware has no card reader; flash the one of this version"),
        result => accepted(result, "GS_SIGN needs a signed command; give --key FILE"),
    }
}

#[cfg(test)]
mod tests {
    use hums_link::messages::command_ack;
    use hums_link::packet::Fields;

    use super::*;
    use crate::talk::tests::fake::found;

    #[test]
    fn the_board_is_told_once_more_and_its_refusal_is_said() {
        let mut asked = 0;
        let mut client = found(&[1], move |frame| {
            let fields = Fields(frame.payload());
            if (frame.id(), fields.u16(28), fields.f32(0).to_bits())
                != (76, PREFLIGHT_REBOOT_SHUTDOWN, MASS_STORAGE.to_bits())
            {
                return Vec::new();
            }
            asked += 1;
            if asked == 1 {
                Vec::new()
            } else {
                vec![(1, command_ack(PREFLIGHT_REBOOT_SHUTDOWN, 0, 255, 190))]
            }
        });
        tell(&mut client).expect("accepted");
        let refusals = [(1, "armed"), (2, "GS_SIGN"), (3, "no card reader"), (9, "MAV_RESULT 9")];
        for (result, wanted) in refusals {
            let mut client =
                found(&[1], move |_| vec![(1, command_ack(PREFLIGHT_REBOOT_SHUTDOWN, result, 255, 190))]);
            let error = tell(&mut client).expect_err("refused").to_string();
            assert!(error.contains(wanted), "{error}");
        }
    }
}
