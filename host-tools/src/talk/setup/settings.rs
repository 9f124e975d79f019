//! The autopilot's settings for the box: compared, set, and restored from a file of former values.

use std::io::Write as _;
use std::path::Path;

use anyhow::{Context as _, Result, bail};
use hums_link::param_line::{self, Line};
use serde::Serialize;

use super::{ARDUPILOT, BoxSettings, CheckLine, HeardAutopilot, PX4, TRIES, autopilot, line};
use crate::colour::level;
use crate::files::{Inputs, Output, read_short, settle};
use crate::outcome::{Outcome, usage};
use crate::output;
use crate::printable::word;
use crate::table::{Table, left, right};
use crate::talk::Client;
use crate::talk::params::{self, Param};

/// `MAV_PARAM_TYPE`: integers up to 32 bits. PX4 sends their bits in the place of a float.
const INTEGERS: std::ops::RangeInclusive<u8> = 1..=6;
const UNDO_BYTES_MAX: u64 = 64 * 1024;
/// PX4's `MAV_X_RATE` at 921,600 baud, bytes per second.
const RATE_BYTES: u32 = 80_000;
/// PX4 has TELEM 1 to 4.
const TELEM_MAX: u8 = 4;
/// `SERIALn_PROTOCOL` of a port for the box: none, MAVLink 1 or 2.
const FREE: [f64; 3] = [-1.0, 1.0, 2.0];

/// A parameter of the autopilot.
#[derive(Debug, Serialize)]
pub(super) struct Setting {
    /// Name of the parameter.
    name: String,
    /// `null` if the autopilot did not answer.
    now: Option<f64>,
    /// The value for the box.
    wanted: f64,
    /// A larger value is good too.
    at_least: bool,
    /// The reason.
    why: &'static str,
    #[serde(skip)]
    kind: u8,
    /// Not every autopilot has it.
    #[serde(skip)]
    is_optional: bool,
}

impl Setting {
    fn new(name: String, wanted: impl Into<f64>, why: &'static str) -> Self {
        let wanted = wanted.into();
        Self { name, now: None, wanted, at_least: false, why, kind: 0, is_optional: false }
    }

    fn differs(&self) -> bool {
        self.now.is_some_and(|now| {
            let is_equal = (now - self.wanted).abs() < 1e-6;
            !(is_equal || self.at_least && now > self.wanted)
        })
    }

    fn state(&self) -> &'static str {
        match self.now {
            None if self.is_optional => "ok",
            None => "unknown",
            Some(_) if self.differs() => "warning",
            Some(_) => "ok",
        }
    }
}

/// The wanted settings with the present values; empty for another autopilot, and for a PX4 that does not answer.
pub(super) fn wanted(
    client: &mut Client,
    autopilot: u8,
    port: u8,
    own: &BoxSettings,
) -> Result<Vec<Setting>> {
    let mut settings = match autopilot {
        ARDUPILOT => ardupilot(port, own),
        PX4 => instance(client, port)?.map_or_else(Vec::new, |instance| px4(port, instance, own)),
        _ => return Ok(Vec::new()),
    };
    for setting in &mut settings {
        let Some(param) = params::ask(client, &setting.name, TRIES)? else {
            // A link on which nothing is answered is not asked further.
            if setting.is_optional {
                continue;
            }
            break;
        };
        (setting.now, setting.kind) = (Some(value(autopilot, &param)), param.kind);
    }
    Ok(settings)
}

/// `SERIALn_BAUD` is in thousands, cut off.
fn ardupilot(port: u8, own: &BoxSettings) -> Vec<Setting> {
    let flow = Setting::new(format!("BRD_SER{port}_RTSCTS"), 0, "CTS and RTS are open");
    vec![
        Setting::new(format!("SERIAL{port}_PROTOCOL"), 2, "MAVLink 2"),
        Setting::new(format!("SERIAL{port}_BAUD"), own.baud / 1_000, "the box's AP_BAUD"),
        Setting { is_optional: true, ..flow },
    ]
}

/// TELEM 1 to 4 are 101 to 104 in `MAV_n_CONFIG`.
fn px4(port: u8, instance: u8, own: &BoxSettings) -> Vec<Setting> {
    let rate = RATE_BYTES.min(own.baud / 12);
    let mut settings = vec![
        Setting::new(format!("MAV_{instance}_CONFIG"), 100 + port, "MAVLink at this port"),
        Setting::new(format!("SER_TEL{port}_BAUD"), own.baud, "the box's AP_BAUD"),
        Setting::new(format!("MAV_{instance}_MODE"), 2, "Onboard: the streams for companions"),
        Setting { at_least: true, ..Setting::new(format!("MAV_{instance}_RATE"), rate, "bytes per second") },
        Setting::new(format!("MAV_{instance}_FLOW_CTRL"), 0, "CTS and RTS are open"),
    ];
    if own.path == 2 {
        let why = "the autopilot's radio carries the box's texts (GS_PATH 2)";
        settings.push(Setting::new(format!("MAV_{instance}_FORWARD"), 1, why));
    }
    settings
}

/// The MAVLink instance of this port, else a free one; `None` if the autopilot does not answer for each.
fn instance(client: &mut Client, port: u8) -> Result<Option<u8>> {
    if port > TELEM_MAX {
        return Err(usage(format!("--port {port}: PX4 has TELEM 1 to {TELEM_MAX}; give the box's")));
    }
    let mut free = None;
    for instance in 0..3 {
        let Some(param) = params::ask(client, &format!("MAV_{instance}_CONFIG"), TRIES)? else {
            return Ok(None);
        };
        let config = value(PX4, &param);
        if (config - f64::from(100 + port)).abs() < 0.5 {
            return Ok(Some(instance));
        }
        free = free.or((config.abs() < 0.5).then_some(instance));
    }
    free.map(Some).with_context(|| {
        format!(
            "TELEM {port} has no MAVLink, and MAV_0_CONFIG to MAV_2_CONFIG have other ports: give the box's port with --port, or set one of \
             them to 0"
        )
    })
}

fn value(autopilot: u8, param: &Param) -> f64 {
    if autopilot == PX4 && INTEGERS.contains(&param.kind) {
        f64::from(param.value.to_bits().cast_signed())
    } else {
        f64::from(param.value)
    }
}

fn sent(autopilot: u8, kind: u8, value: f64) -> f32 {
    if autopilot == PX4 && INTEGERS.contains(&kind) {
        f32::from_bits((value as i32).cast_unsigned())
    } else {
        value as f32
    }
}

/// Sets what differs, after the present values are in a file.
pub(super) fn change(client: &mut Client, settings: &mut [Setting], file: &Path) -> Result<()> {
    settable(client)?;
    if settings.iter().all(|setting| setting.now.is_none()) {
        bail!(
            "the autopilot does not answer: nothing is set; connect to its USB or radio, or set the box's GS_PASS to 1"
        );
    }
    let other = |setting: &&Setting| {
        setting.name.ends_with("_PROTOCOL") && setting.now.is_some_and(|now| !FREE.contains(&now))
    };
    if let Some(Setting { name, now: Some(now), .. }) = settings.iter().find(other) {
        bail!(
            "{name} is {now}, so the port has another use and nothing is set: give the box's port with --port, or set it to -1 (none)"
        );
    }
    let different: Vec<&mut Setting> = settings.iter_mut().filter(|setting| setting.differs()).collect();
    if different.is_empty() {
        note!("all settings are as wanted: nothing is set, and {} is not written", file.display());
        return Ok(());
    }
    let mut undo = Output::create(file, &Inputs::none())?;
    for setting in &different {
        let line = format!("{},{}\n", setting.name, setting.now.unwrap_or_default());
        settle(undo.write_all(line.as_bytes()), file)?;
    }
    undo.finish()?;
    for setting in different {
        set(client, &setting.name, setting.kind, setting.wanted).with_context(|| {
            format!("{}; --restore {} sets the former values", setting.name, file.display())
        })?;
        setting.now = Some(setting.wanted);
    }
    note!("restart the autopilot; --restore {} sets the former values", file.display());
    Ok(())
}

/// The autopilot, if its next heartbeat says that it is disarmed.
fn settable(client: &mut Client) -> Result<HeardAutopilot> {
    let heard = autopilot(client)?.context(
        "the autopilot is not heard on this link: connect to the autopilot's USB or radio, or set the box's GS_PASS to 1",
    )?;
    if heard.is_armed {
        bail!("the vehicle is armed: nothing is set; disarm it first");
    }
    Ok(heard)
}

fn set(client: &mut Client, name: &str, kind: u8, wanted: f64) -> Result<()> {
    let HeardAutopilot { autopilot, .. } = settable(client)?;
    let kept = params::set(client, name, sent(autopilot, kind, wanted), kind)?;
    let kept = value(autopilot, &kept);
    if (kept - wanted).abs() > wanted.abs() * 1e-6 {
        bail!("the autopilot refused {wanted} and keeps {kept}; see its documentation for the range");
    }
    Ok(())
}

pub(super) fn values_of(file: &Path) -> Result<Vec<(String, f64)>> {
    let wrong =
        |number: usize| usage(format!("{}: line {number} is no NAME,VALUE; correct it", file.display()));
    let bytes = read_short(file, UNDO_BYTES_MAX).context("--restore")?;
    let text = String::from_utf8(bytes)
        .map_err(|_| usage(format!("{}: is not a text file; name the file of --undo", file.display())))?;
    let mut values = Vec::new();
    for (number, line) in (1..).zip(text.lines()) {
        match param_line::read(line) {
            Line::Nothing => {}
            Line::Set(name, value) => {
                let value = value.parse::<f64>().ok().filter(|value| value.is_finite());
                values.push((name.to_owned(), value.ok_or_else(|| wrong(number))?));
            }
            Line::Wrong => return Err(wrong(number)),
        }
    }
    Ok(values)
}

/// Sets all that it can.
pub(super) fn restore(client: &mut Client, values: &[(String, f64)]) -> Result<Outcome> {
    let mut failed = Vec::new();
    for (name, wanted) in values {
        let done = params::ask(client, name, TRIES).and_then(|param| {
            let param = param.context("the autopilot does not answer; check the link")?;
            set(client, name, param.kind, *wanted)
        });
        match done {
            Ok(()) => output::line(&format!("{} {wanted}", word(name)))?,
            Err(error) => failed.push(format!("{}: {error:#}", word(name))),
        }
    }
    if !failed.is_empty() {
        bail!("{} of {} not restored; call again\n{}", failed.len(), values.len(), failed.join("\n"));
    }
    output::line("restored; restart the autopilot")?;
    Ok(Outcome::Done)
}

pub(super) fn show(heard: Option<HeardAutopilot>, settings: &[Setting]) -> Result<()> {
    let name = match heard.map(|heard| heard.autopilot) {
        Some(ARDUPILOT) => "ArduPilot's settings",
        Some(PX4) => "PX4's settings",
        Some(_) => return output::line("settings of this autopilot are not known: its port sends MAVLink 2"),
        None => return output::line("the autopilot is not heard on this link: its settings were not read"),
    };
    let mut table = Table::new(2, [left(7), left(0), right(0), right(0), left(0)]);
    table.heading(["", "parameter", "now", "wanted", "because"]);
    for setting in settings {
        let least = if setting.at_least { "at least " } else { "" };
        let now = setting.now.map_or_else(|| "-".to_owned(), |now| now.to_string());
        let wanted = format!("{least}{}", setting.wanted);
        table.row([
            level(setting.state()).to_string(),
            setting.name.clone(),
            now,
            wanted,
            setting.why.to_owned(),
        ]);
    }
    output::line(&format!("{name}\n{}", table.text()))
}

pub(super) fn check(settings: &[Setting]) -> CheckLine {
    let of = |is_it: fn(&Setting) -> bool| {
        let names = settings.iter().filter(|setting| is_it(setting)).map(|setting| setting.name.as_str());
        names.collect::<Vec<_>>().join(", ")
    };
    let (different, unknown) = (of(Setting::differs), of(|setting| setting.state() == "unknown"));
    match (different.is_empty(), unknown.is_empty() && !settings.is_empty()) {
        (false, _) => line("settings", false, format!("{different}: --set --undo FILE sets them")),
        (true, true) => line("settings", true, "as wanted"),
        (true, false) => CheckLine {
            check: "settings",
            state: "unknown",
            detail: "the autopilot does not answer here: connect to its USB or radio, or set GS_PASS to 1"
                .to_owned(),
        },
    }
}
#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use hums_link::messages;
    use hums_link::packet::{Fields, Packet};

    use super::*;
    use crate::mavlink::ids::{HEARTBEAT, PARAM_REQUEST_READ, PARAM_SET};
    use crate::talk::setup::{ARMED, AUTOPILOT};
    use crate::talk::tests::fake::found;

    const OWN: BoxSettings = BoxSettings { baud: 57_600, path: 2, has_streams: false };

    fn vehicle(autopilot: u8, mut mode: u8, values: &[(&str, f32, u8)]) -> Client {
        let mut values: BTreeMap<String, (f32, u8)> =
            values.iter().map(|(name, value, kind)| ((*name).to_owned(), (*value, *kind))).collect();
        let mut client = found(&[1], move |frame| {
            let fields = Fields(frame.payload());
            let at = match frame.id() {
                HEARTBEAT => {
                    return vec![(1, Packet::new(HEARTBEAT).u8(4, 2).u8(5, autopilot).u8(6, mode).u8(7, 3))];
                }
                PARAM_REQUEST_READ => 4,
                PARAM_SET => 6,
                _ => return Vec::new(),
            };
            let name = fields.text(at, 16).unwrap_or_default();
            let Some((value, kind)) = values.get_mut(name) else { return Vec::new() };
            if frame.id() == PARAM_SET && name != "REFUSED" {
                *value = fields.f32(0);
                mode |= if name == "ARMING" { ARMED } else { 0 };
            }
            vec![(1, messages::param_value(name, *value, 0, 9).u8(24, *kind))]
        });
        client.turn_to(AUTOPILOT);
        client
    }

    fn bits(value: i32) -> f32 {
        f32::from_bits(value.cast_unsigned())
    }

    #[test]
    fn an_ardupilot_is_compared_set_and_restored() {
        let dir = tempfile::tempdir().expect("a folder");
        let (first, second) = (dir.path().join("undo.param"), dir.path().join("again.param"));
        let mut client = vehicle(
            ARDUPILOT,
            0,
            &[("SERIAL2_PROTOCOL", 1.0, 2), ("SERIAL2_BAUD", 115.0, 4), ("BRD_SER2_RTSCTS", 0.0, 2)],
        );
        let differ = |client: &mut Client| {
            let all = wanted(client, ARDUPILOT, 2, &OWN).expect("a link");
            let names: Vec<String> =
                all.iter().filter(|setting| setting.differs()).map(|setting| setting.name.clone()).collect();
            (all, names)
        };
        let (mut all, names) = differ(&mut client);
        assert_eq!((names, all.len()), (vec!["SERIAL2_PROTOCOL".to_owned(), "SERIAL2_BAUD".to_owned()], 3));
        assert_eq!(check(&all).state, "missing");
        change(&mut client, &mut all, &first).expect("set");
        assert_eq!(
            std::fs::read_to_string(&first).expect("a file"),
            "SERIAL2_PROTOCOL,1\nSERIAL2_BAUD,115\n"
        );
        let (mut all, names) = differ(&mut client);
        assert!(names.is_empty() && check(&all).state == "ok", "{names:?}");
        change(&mut client, &mut all, &second).expect("nothing to do");
        assert!(!second.exists(), "nothing was changed");
        assert!(change(&mut client, &mut [], &second).is_err(), "nothing was answered");
        // The others are restored too.
        let mut values = vec![("GONE".to_owned(), 1.0)];
        values.extend(values_of(&first).expect("values"));
        let error = restore(&mut client, &values).expect_err("not all").to_string();
        assert!(error.starts_with("1 of 3 not restored") && error.contains("GONE"), "{error}");
        assert_eq!(differ(&mut client).1, ["SERIAL2_PROTOCOL", "SERIAL2_BAUD"]);
    }

    #[test]
    fn a_port_that_has_another_use_is_left_to_it() {
        let dir = tempfile::tempdir().expect("a folder");
        let file = dir.path().join("undo");
        let mut client = vehicle(ARDUPILOT, 0, &[("SERIAL2_PROTOCOL", 23.0, 2), ("SERIAL2_BAUD", 115.0, 4)]);
        let mut all = wanted(&mut client, ARDUPILOT, 2, &OWN).expect("a link");
        let error = change(&mut client, &mut all, &file).expect_err("a receiver's").to_string();
        assert!(error.starts_with("SERIAL2_PROTOCOL is 23") && !file.exists(), "{error}");
        let configs = [101, 103, 1_000].map(bits);
        let all = [
            ("MAV_0_CONFIG", configs[0], 6),
            ("MAV_1_CONFIG", configs[1], 6),
            ("MAV_2_CONFIG", configs[2], 6),
        ];
        let error = instance(&mut vehicle(PX4, 0, &all), 2).expect_err("none is free").to_string();
        assert!(error.contains("MAV_2_CONFIG"), "{error}");
        // Nobody knows the instance without an answer.
        assert_eq!(instance(&mut vehicle(PX4, 0, &all[..2]), 2).expect("a link"), None);
        assert!(
            instance(&mut vehicle(PX4, 0, &all), 5).expect_err("no such port").is::<crate::outcome::Usage>()
        );
    }

    #[test]
    fn a_px4_has_whole_numbers_as_bits_and_the_instance_of_the_port() {
        let dir = tempfile::tempdir().expect("a folder");
        let mut client = vehicle(
            PX4,
            0,
            &[
                ("MAV_0_CONFIG", bits(101), 6),
                ("MAV_1_CONFIG", bits(0), 6),
                ("MAV_2_CONFIG", bits(0), 6),
                ("SER_TEL2_BAUD", bits(921_600), 6),
                ("MAV_1_MODE", bits(2), 6),
                ("MAV_1_RATE", bits(0), 6),
                ("MAV_1_FLOW_CTRL", bits(0), 6),
                ("MAV_1_FORWARD", bits(1), 6),
            ],
        );
        let mut all = wanted(&mut client, PX4, 2, &OWN).expect("a link");
        let now: Vec<(&str, Option<f64>, bool)> =
            all.iter().map(|setting| (setting.name.as_str(), setting.now, setting.differs())).collect();
        assert_eq!(
            now,
            [
                ("MAV_1_CONFIG", Some(0.0), true),
                ("SER_TEL2_BAUD", Some(921_600.0), true),
                ("MAV_1_MODE", Some(2.0), false),
                ("MAV_1_RATE", Some(0.0), true),
                ("MAV_1_FLOW_CTRL", Some(0.0), false),
                ("MAV_1_FORWARD", Some(1.0), false),
            ]
        );
        change(&mut client, &mut all, &dir.path().join("undo")).expect("set");
        let kept = params::ask(&mut client, "SER_TEL2_BAUD", 1).expect("a link").expect("an answer");
        assert_eq!((kept.value.to_bits(), instance(&mut client, 2).expect("a link")), (57_600, Some(1)));
        assert_eq!(instance(&mut client, 1).expect("a link"), Some(0));
    }

    #[test]
    fn nothing_is_set_while_armed_nor_on_an_autopilot_that_is_not_heard() {
        let dir = tempfile::tempdir().expect("a folder");
        let file = dir.path().join("undo");
        let one = |name: &str| Setting { now: Some(0.0), ..Setting::new(name.to_owned(), 2, "") };
        let armed = vehicle(ARDUPILOT, ARMED, &[("OTHER", 0.0, 4)]);
        for (mut client, words) in [(armed, "armed"), (found(&[1], |_| Vec::new()), "not heard")] {
            client.turn_to(AUTOPILOT);
            let error = change(&mut client, &mut [one("OTHER")], &file).expect_err("refused").to_string();
            assert!(error.contains(words) && !file.exists(), "{error}");
        }
        // A refused value is an error that names the file. A vehicle that arms meanwhile gets no more.
        let mut client = vehicle(ARDUPILOT, 0, &["REFUSED", "ARMING", "OTHER"].map(|name| (name, 0.0, 4)));
        let error = change(&mut client, &mut [one("REFUSED")], &file).expect_err("refused");
        let error = format!("{error:#}");
        assert!(error.contains("refused 2 and keeps 0") && error.contains("--restore"), "{error}");
        let file = dir.path().join("second");
        let error = change(&mut client, &mut [one("ARMING"), one("OTHER")], &file).expect_err("armed");
        let other = params::ask(&mut client, "OTHER", 1).expect("a link").expect("an answer");
        assert!(format!("{error:#}").contains("armed") && other.value.to_bits() == 0, "{error:#}");
    }

    #[test]
    fn a_file_of_former_values_with_another_line_is_refused_as_a_whole() {
        let dir = tempfile::tempdir().expect("a folder");
        let file = dir.path().join("values");
        for (text, is_good) in [("A,1\n# note\nB 2.5\n", true), ("A,1\nB\n", false), ("A,inf\n", false)] {
            std::fs::write(&file, text).expect("written");
            assert_eq!(values_of(&file).is_ok(), is_good, "{text}");
        }
    }
}
