//! Recording by arming: what is around the times when the vehicle is armed is kept, and the rest is no damage.

use std::fs;
use std::path::{Path, PathBuf};

use hums_tests::fat;
use hums_tests::flights::{Manifest, own};
use hums_tests::frames::{self, Frame};
use hums_tests::program::{Machine, Recording, hums};

/// The vehicle is armed after some 44 s.
const FLIGHT: &str = "ap_quad_guided.tlog";
const ARMED_BIT: u8 = 0x80;

/// A file of parameters, in a folder that goes with it.
fn params(dir: &Path, text: &str) -> PathBuf {
    let path = dir.join("params");
    fs::write(&path, text).unwrap();
    path
}

/// Whether a frame is the autopilot's heartbeat, and whether it says armed.
fn armed(frame: &Frame<'_>) -> Option<bool> {
    let header = if frame.bytes[0] == 0xFE { 6 } else { 10 };
    // MAVLink 2 sends no zeros at a payload's end.
    let byte = |at: usize| frame.bytes.get(header + at).copied().unwrap_or(0);
    let is_autopilot = byte(5) != 8;
    (frame.id == 0 && is_autopilot).then(|| byte(6) & ARMED_BIT != 0)
}

fn tlogs(image: &Path, dir: &Path) -> Vec<Vec<u8>> {
    let out = dir.join("out");
    let decode = ["decode".as_ref(), image.as_os_str(), "-o".as_ref(), out.as_os_str()];
    hums(decode.into_iter().chain(["--format".as_ref(), "tlog".as_ref()])).expect_code(&[0]);
    if out.is_file() {
        return vec![fs::read(out).unwrap()];
    }
    let mut files: Vec<_> = fs::read_dir(out).unwrap().map(|file| file.unwrap().path()).collect();
    files.retain(|file| file.extension().is_some_and(|extension| extension == "tlog"));
    files.sort();
    files.iter().map(|file| fs::read(file).unwrap()).collect()
}

#[test]
fn the_time_before_arming_is_kept_and_what_is_not_kept_is_told_as_such() {
    let dir = tempfile::tempdir().unwrap();
    let params = params(dir.path(), "REC_MODE 1\nREC_BEFORE 5\n");
    let recording = Recording::make(
        Machine::Sim,
        &own(FLIGHT),
        &["--card-size", "64", "--params", &params.display().to_string()],
    );
    fat::assert_clean(&recording.image());
    let manifest = Manifest::own();
    let data = fs::read(own(FLIGHT)).unwrap();
    let input = manifest.frames_of(&own(FLIGHT), &data);
    let decoded = recording.decode(&[0]);
    let output = decoded.frames(&manifest.seeds);
    let from = input.len() - output.len();
    assert!(from > 0, "everything was kept");
    assert!(output.iter().zip(&input[from..]).all(|(a, b)| a.bytes == b.bytes), "not the end of the flight");
    let arming = input.iter().position(|frame| armed(frame) == Some(true)).expect("it is armed");
    let seconds = |index: usize| (input[index].time_us.unwrap() - input[0].time_us.unwrap()) as f64 / 1e6;
    let before_s = seconds(arming) - seconds(from);
    assert!((5.0..25.0).contains(&before_s), "{before_s} s before arming are kept");

    let image = recording.image();
    let verify = hums(["verify".as_ref(), image.as_os_str()]).expect_code(&[0]);
    assert!(verify.text().contains("not recorded while disarmed"), "{}", verify.text());
    let info = hums(["info".as_ref(), image.as_os_str()]).expect_code(&[0]).text();
    assert!(info.contains("not recorded: disarmed") && info.contains("gaps     none"), "{info}");
    // The file can be read by itself: what its first one said is said again.
    assert!(info.contains("vehicle  system 1") && info.contains("on sim"), "{info}");
}

#[test]
fn each_armed_time_is_a_log_of_its_own() {
    let dir = tempfile::tempdir().unwrap();
    let manifest = Manifest::own();
    let data = fs::read(own(FLIGHT)).unwrap();
    let input = manifest.frames_of(&own(FLIGHT), &data);
    let (first, last) = (input[0].time_us.unwrap(), input.last().unwrap().time_us.unwrap());
    // The same flight again ten seconds later, on the same power-on.
    let twice: Vec<u8> = [0, last - first + 10_000_000]
        .iter()
        .flat_map(|later| input.iter().map(move |frame| (frame.time_us.unwrap() + later, frame.bytes)))
        .flat_map(|(time_us, bytes)| [&time_us.to_be_bytes()[..], bytes].concat())
        .collect();
    let flight = dir.path().join("twice.tlog");
    fs::write(&flight, twice).unwrap();
    let params = params(dir.path(), "REC_MODE 1\nREC_BEFORE 5\nREC_AFTER 5\n");
    let recording = Recording::make(
        Machine::Sim,
        &flight,
        &["--card-size", "64", "--params", &params.display().to_string()],
    );
    let logs = tlogs(&recording.image(), dir.path());
    assert_eq!(logs.len(), 2, "two times armed");
    for tlog in &logs {
        let frames = frames::of_tlog(tlog, &manifest.seeds, true);
        let changes: Vec<bool> = frames.iter().filter_map(armed).collect();
        assert!(!changes[0] && changes.contains(&true), "it begins disarmed and is armed then");
        assert!(frames.len() < input.len(), "not all of the time before is kept");
        let armed_frames =
            |frames: &[Frame<'_>]| frames.iter().filter(|frame| armed(frame) == Some(true)).count();
        assert_eq!(armed_frames(&frames), armed_frames(&input), "the whole armed time");
    }
    hums(["verify".as_ref(), recording.image().as_os_str()]).expect_code(&[0]);
}

#[test]
fn a_vehicle_that_is_never_armed_leaves_the_last_while() {
    let dir = tempfile::tempdir().unwrap();
    let manifest = Manifest::own();
    let data = fs::read(own(FLIGHT)).unwrap();
    let input = manifest.frames_of(&own(FLIGHT), &data);
    let arming = input.iter().position(|frame| armed(frame) == Some(true)).expect("it is armed");
    let entry = |frame: &Frame<'_>| [&frame.time_us.unwrap().to_be_bytes()[..], frame.bytes].concat();
    let disarmed: Vec<u8> = input[..arming].iter().flat_map(entry).collect();
    let flight = dir.path().join("disarmed.tlog");
    fs::write(&flight, disarmed).unwrap();
    let params = params(dir.path(), "REC_MODE 1\nREC_BEFORE 10\n");
    let recording = Recording::make(
        Machine::Sim,
        &flight,
        &["--card-size", "64", "--params", &params.display().to_string()],
    );
    let decoded = recording.decode(&[0]);
    let output = decoded.frames(&manifest.seeds);
    let from = arming - output.len();
    assert!(output.iter().zip(&input[from..arming]).all(|(a, b)| a.bytes == b.bytes), "not its end");
    let kept_s = (input[arming - 1].time_us.unwrap() - input[from].time_us.unwrap()) as f64 / 1e6;
    assert!((10.0..35.0).contains(&kept_s), "{kept_s} s are kept");
    hums(["verify".as_ref(), recording.image().as_os_str()]).expect_code(&[0]);
}
