use std::fs;
use std::path::Path;

use hums_core::observation::{Gnss, Hud, Observation};
use hums_core::units::Metres;
use hums_dialect::Kind;

use super::*;
use crate::source::find::find;

const PLACE: (f64, f64) = (47.397_922_9, 8.545_817_9);
const ALTITUDE_M: f64 = 516.24;
const PRESSURE_HPA: f32 = 952.76;
const UTC_US: u64 = 1_795_210_115_657_672;
const UID: u64 = 0x0031_002a_3035_510a;
const WORDS: &str = "SN4711Zurich";

fn secrets() -> Vec<Vec<u8>> {
    let mut all = Vec::new();
    for degrees in [PLACE.0, PLACE.1] {
        all.push(((degrees * 1e7).round() as i32).to_le_bytes().to_vec());
        all.push((degrees as f32).to_le_bytes().to_vec());
        all.push(degrees.to_le_bytes().to_vec());
        all.push(format!("{degrees:.4}").into_bytes());
    }
    all.push(((ALTITUDE_M * 1e3) as i32).to_le_bytes().to_vec());
    all.push((ALTITUDE_M as f32).to_le_bytes().to_vec());
    all.push(PRESSURE_HPA.to_le_bytes().to_vec());
    all.extend([UTC_US.to_le_bytes().to_vec(), UTC_US.to_be_bytes().to_vec()]);
    all.extend([UID.to_le_bytes().to_vec(), (UID as u32).to_le_bytes().to_vec()]);
    all.extend(["SN4711", "Zurich"].map(|word| word.as_bytes().to_vec()));
    all
}

/// A value of a field: a secret unless the field stays as it is.
fn planted(place: &rules::FieldRule) -> Vec<u8> {
    let (rule, kind) = (place.rule, place.kind);
    let mut bytes = match (rule, kind) {
        (Some(Rule::Keep), _) => vec![1; place.size],
        (Some(Rule::Time), _) => UTC_US.to_le_bytes().to_vec(),
        (Some(Rule::Longitude), _) => ((PLACE.1 * 1e7).round() as i32).to_le_bytes().to_vec(),
        (Some(Rule::Altitude), Kind::I32) => ((ALTITUDE_M * 1e3) as i32).to_le_bytes().to_vec(),
        (Some(Rule::Altitude), _) => (ALTITUDE_M as f32).to_le_bytes().to_vec(),
        (Some(Rule::Pressure), _) => PRESSURE_HPA.to_le_bytes().to_vec(),
        (_, Kind::I32) => ((PLACE.0 * 1e7).round() as i32).to_le_bytes().to_vec(),
        (_, Kind::F32) => (PLACE.0 as f32).to_le_bytes().to_vec(),
        (_, Kind::F64) => PLACE.0.to_le_bytes().to_vec(),
        (_, Kind::U64 | Kind::U32) => UID.to_le_bytes().to_vec(),
        _ => WORDS.as_bytes().to_vec(),
    };
    bytes = bytes.repeat(place.size.div_ceil(bytes.len()));
    bytes.truncate(place.size);
    bytes
}

fn record(at_us: u64, packet: &Packet) -> Vec<u8> {
    let mut buffer = [0; FRAME_BYTES_MAX];
    [&(UTC_US + at_us).to_be_bytes()[..], Encoder::of(1, 1).frame(&mut buffer, packet)].concat()
}

/// The copy, and the lines about it.
fn share(input: &Path, output: &Path) -> (Vec<u8>, Vec<String>) {
    let args =
        args::Share { input: input.to_owned(), session: None, output: output.to_owned(), force: false };
    let (share, _) = copy(&args).expect("a copy");
    (fs::read(output).expect("the copy"), share.told(&args))
}

#[track_caller]
fn assert_silent(copy: &[u8], secrets: &[Vec<u8>]) {
    for secret in secrets {
        let found = memchr::memmem::find(copy, secret);
        assert_eq!(found, None, "{secret:x?} of {} bytes", copy.len());
    }
}

fn observations(path: &Path) -> Vec<Observation> {
    let found = find(&[path.to_owned()], false).expect("a log");
    let mut observations = Vec::new();
    let want = Needs { observations: true, ..Needs::default() };
    let read = found.places[0].open().expect("open").read(want, &mut |_, item| {
        if let Item::Observation(_, observation) = item {
            observations.push(*observation);
        }
        Ok(())
    });
    read.expect("a reading");
    observations
}

#[test]
fn no_fact_of_any_message_is_in_the_copy_of_a_recording() {
    let dir = tempfile::tempdir().expect("a folder");
    let (input, output) = (dir.path().join("in.tlog"), dir.path().join("out.tlog"));
    let rules = Rules::default();
    let mut tlog = Vec::new();
    let global = |north: i32, up: i32| {
        let at = |degrees: f64| (degrees * 1e7).round() as i32;
        let packet = Packet::new(33).bytes(4, &(at(PLACE.0) + north).to_le_bytes());
        let packet = packet.bytes(8, &(at(PLACE.1) + north).to_le_bytes());
        let packet = packet.bytes(12, &((ALTITUDE_M * 1e3) as i32 + up).to_le_bytes());
        packet.bytes(16, &up.to_le_bytes())
    };
    let heartbeat = Packet::new(0).bytes(4, &[2, 3, 0x81, 4, 3]);
    tlog.extend(record(0, &heartbeat));
    tlog.extend(record(100, &global(0, 0)));
    tlog.extend(record(200, &global(10_000, 20_000)));
    for (at, message) in (1..).zip(hums_dialect::messages()) {
        let all = rules::places(message, &BTreeMap::default());
        let fields = rules.fields(message.id).unwrap_or(&all);
        let packet = fields
            .iter()
            .fold(Packet::new(message.id), |packet, place| packet.bytes(place.at, &planted(place)));
        if [STATUSTEXT, PARAM_VALUE].contains(&message.id) {
            let secret = Packet::new(message.id).bytes(0, &vec![b'Z'; message.len_base.into()]);
            let words =
                if message.id == STATUSTEXT { secret.text(1, 50, WORDS) } else { secret.text(8, 16, WORDS) };
            tlog.extend(record(at * 1_000, &words));
        } else {
            tlog.extend(record(at * 1_000, &packet));
        }
    }
    fs::write(&input, &tlog).expect("written");
    let secrets = secrets();
    for secret in &secrets[..2] {
        assert!(tlog.windows(secret.len()).any(|part| part == secret), "it is planted");
    }
    let (copy, told) = share(&input, &output);
    assert!(copy.len() > 2_000, "{}", copy.len());
    assert_silent(&copy, &secrets);
    for removed in
        ["1 of 1 HOME_POSITION", "1 of 1 STATUSTEXT", "1 of 1 PARAM_VALUE", "1 of 1 AUTOPILOT_VERSION.uid"]
    {
        assert!(told.iter().any(|line| line == &format!("removed: {removed}")), "{removed}: {told:#?}");
    }
    // The way stays as it was.
    let places = observations(&output).into_iter().filter_map(|observation| match observation {
        Observation::GlobalPosition(global) => {
            Some((global.position?, global.altitude.0, global.relative_altitude.0))
        }
        _ => None,
    });
    let places: Vec<_> = places.collect();
    let ((from, low, _), (to, high, height)) = (places[0], places[1]);
    assert!((from.latitude_deg - 45.0).abs() < 1e-6 && (from.longitude_deg + 30.0).abs() < 1e-6, "{from:?}");
    assert!((to.latitude_deg - from.latitude_deg - 1e-3).abs() < 2e-7, "{to:?}");
    let east_m = |degrees: f64, latitude: f64| degrees * latitude.to_radians().cos();
    let (before, after) = (east_m(1e-3, PLACE.0), east_m(to.longitude_deg - from.longitude_deg, 45.0));
    assert!((before - after).abs() < 2e-7, "{before} {after}");
    assert_eq!((high - low, height), (20.0, 20.0));
}

/// An estimator that begins at 0 learns its height above sea level; the receiver knew it before.
#[test]
fn no_altitude_tells_the_height_of_the_place() {
    let mut moved = Displacement::default();
    for (altitude, expected) in [(1.0, 0.0), (1.5, 0.5), (603.0, 0.0), (605.0, 2.0), (555.5, -47.5)] {
        let hud = |metres| Hud {
            airspeed: None,
            groundspeed: None,
            heading_deg: None,
            throttle: None,
            altitude: Some(Metres(metres)),
            climb: None,
        };
        let copy = moved.observation(&Observation::Hud(hud(altitude)));
        assert_eq!(copy, Some(Observation::Hud(hud(expected))));
    }
    let gnss = Gnss { altitude: Some(Metres(588.0)), ..Gnss::default() };
    let Some(Observation::Gnss(copy)) = moved.observation(&Observation::Gnss(gnss)) else { panic!("kept") };
    assert_eq!(copy.altitude, Some(Metres(0.0)));
}

#[test]
fn an_autopilots_own_log_gives_nothing_away_either() {
    let dir = tempfile::tempdir().expect("a folder");
    let input =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/labelled/px4/p23_motor_dead_quad.cut.ulg.gz");
    let output = dir.path().join("out.ulg");
    let mut secrets = Vec::new();
    for observation in observations(&input) {
        match observation {
            Observation::GlobalPosition(global) => {
                let place = global.position.map(|place| [place.latitude_deg, place.longitude_deg]);
                for degrees in place.into_iter().flatten() {
                    secrets.push(degrees.to_le_bytes().to_vec());
                    secrets.push(((degrees * 1e7).round() as i32).to_le_bytes().to_vec());
                }
                secrets.push(global.altitude.0.to_le_bytes().to_vec());
            }
            Observation::Identity(identity) if identity.uid != 0 => {
                secrets.push(format!("{:016x}", identity.uid).into_bytes());
            }
            _ => {}
        }
    }
    secrets.sort_unstable();
    secrets.dedup();
    assert!(secrets.len() > 10, "{}", secrets.len());
    // A thousand are enough of a search in all bytes.
    let few: Vec<Vec<u8>> = secrets.iter().step_by(secrets.len().div_ceil(1_000)).cloned().collect();
    assert_silent(&share(&input, &output).0, &few);
    let near = |observation: &Observation| match observation {
        Observation::GlobalPosition(global) => {
            global.position.is_none_or(|place| (place.latitude_deg - 45.0).abs() < 1.0)
        }
        _ => true,
    };
    let copied = observations(&output);
    assert!(copied.len() > 100 && copied.iter().all(near), "{}", copied.len());
}
