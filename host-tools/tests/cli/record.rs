//! Recording: sources, destinations and settings. The contents of cards are tested end to end (`tests/sim`).

use std::fs;
use std::io::Write;
use std::net::{TcpListener, UdpSocket};

use crate::support::{attempt, end_of, flight, frames_of, hums, json, piped, px4, run, stderr, text};

#[test]
fn the_recorded_times_can_be_ignored() {
    let dir = tempfile::tempdir().expect("directory");
    run(dir.path(), "sim PX4 --sd card.img --line-rate 115200", 0);
    let info = json(&run(dir.path(), "info card.img --json", 0));
    let seconds = info["logs"][0]["duration_s"].as_f64().expect("duration");
    let bytes: usize = frames_of(&px4()).iter().map(Vec::len).sum();
    assert!((seconds - bytes as f64 * 10.0 / 115_200.0).abs() < 0.2, "{seconds}");
}

#[test]
fn standard_input_and_output_and_raw_bytes_do_as_well() {
    let dir = tempfile::tempdir().expect("directory");
    let raw = frames_of(&px4()).concat();
    let mut command = hums();
    command.current_dir(dir.path()).args(["sim", "-", "--sd", "card.img", "--gs", "-"]);
    let output = piped(&mut command, &raw);
    assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(
        matches!(output.stdout.first(), Some(0xfd)),
        "the GS stream is on standard output, and nothing else"
    );
    let info = json(&run(dir.path(), "info card.img --json", 0));
    assert_eq!(info["logs"][0]["frames"], 16_645);
}

#[test]
fn a_tcp_server_is_listened_to_until_it_closes() {
    let dir = tempfile::tempdir().expect("directory");
    let server = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = server.local_addr().expect("address");
    let ground = UdpSocket::bind("127.0.0.1:0").expect("a port");
    ground.set_read_timeout(Some(std::time::Duration::from_secs(20))).expect("timeout");
    let sink = ground.local_addr().expect("address");
    let recording = frames_of(&px4());
    let sender = std::thread::spawn(move || {
        let (mut stream, _) = server.accept().expect("a connection");
        stream.write_all(&recording.get(..2000).unwrap_or_default().concat()).expect("sent");
    });
    let line = format!("sim tcp:{address} --sd card.img --gs udpout:{sink} --json");
    let json = json(&run(dir.path(), &line, 0));
    sender.join().expect("the server");
    // A frame in two pieces that a busy machine reads 20 ms apart is lost, as on a UART.
    let frames = json["frames_in"].as_u64().expect("a count");
    assert!((1990..=2000).contains(&frames), "{frames} of 2000 frames");
    let mut datagram = [0; 2048];
    assert_eq!(ground.recv(&mut datagram).expect("a datagram"), 0);
    assert!(ground.recv(&mut datagram).is_ok_and(|got| got > 8), "nothing reached the ground station");
}

#[test]
fn a_card_whose_file_system_is_damaged_stays_as_it_is() {
    let dir = tempfile::tempdir().expect("directory");
    let recording = fs::read(flight("ap_quad_signed.raw")).expect("a recording");
    fs::write(dir.path().join("short.raw"), &recording[..20_000]).expect("written");
    let sim = "sim short.raw --sd card.img";
    run(dir.path(), &format!("{sim} --card-size 34"), 0);
    let image = dir.path().join("card.img");
    let mut bytes = fs::read(&image).expect("an image");
    bytes[(2048 + 32) * 512..][..512].fill(0);
    fs::write(&image, &bytes).expect("written");
    let refused = attempt(dir.path(), sim);
    let told = stderr(&refused);
    assert!(refused.status.code() == Some(2) && told.contains("file system is damaged"), "{told}");
    assert!(fs::read(&image).expect("an image") == bytes, "it was changed");
}

#[test]
fn a_full_card_keeps_its_sessions_unless_the_user_says_so_and_then_each_that_goes_is_told() {
    let dir = tempfile::tempdir().expect("directory");
    let recording = fs::read(flight("ap_quad_signed.raw")).expect("a recording");
    fs::write(dir.path().join("short.raw"), &recording[..20_000]).expect("written");
    let sim = "sim short.raw --sd card.img --json";
    run(dir.path(), &format!("{sim} --card-size 34"), 0);
    let refused = (0..40).map(|_| attempt(dir.path(), sim)).find(|ended| ended.status.code() != Some(0));
    let refused = refused.expect("the card becomes full");
    let told = stderr(&refused);
    assert_eq!(refused.status.code(), Some(2), "{told}");
    assert!(told.contains("would overwrite its oldest session (00001)"), "{told}");
    assert!(told.contains("--overwrite-oldest"), "{told}");
    let sessions = |line: &str| {
        let logs = json(&attempt(dir.path(), line))["logs"].as_array().expect("logs").clone();
        logs.iter().map(|log| log["name"].as_str().expect("a name").to_owned()).collect::<Vec<_>>()
    };
    let before = sessions("info card.img --json");
    assert_eq!(before[0], "00001");
    let stored = attempt(dir.path(), &format!("{sim} --store store.bin"));
    assert_eq!(stored.status.code(), Some(2), "{}", String::from_utf8_lossy(&stored.stderr));
    assert_eq!(sessions("info card.img --json"), before);
    let other = "sim short.raw --sd other.img --json";
    run(dir.path(), &format!("{other} --card-size 34"), 0);
    let starts = " --reboot-at 0.1".repeat(19);
    assert_eq!(attempt(dir.path(), &format!("{other}{starts}")).status.code(), Some(2));
    assert_eq!(sessions("info other.img --json"), ["00001"]);

    let ended = run(dir.path(), &format!("{sim} --overwrite-oldest"), 0);
    let told = stderr(&ended);
    assert!(told.contains("earlier sessions were overwritten, in whole or in part: 00001"), "{told}");
    let report = json(&ended);
    assert_eq!(report["overwritten"], serde_json::json!(["00001"]));
    let after = sessions("info card.img --json");
    let newest = after.last().expect("sessions");
    assert!(!after.contains(&"00001".to_owned()) && !before.contains(newest));
    assert_eq!(report["log_files"], serde_json::json!([format!("{newest}_00.HUM")]));
}

#[test]
fn what_came_damaged_over_the_line_is_said_by_verify_and_is_no_damage_of_the_log() {
    let dir = tempfile::tempdir().expect("directory");
    let recording = end_of("px4_hil_quad_low.tlog", dir.path());
    for (noise, is_told) in [("", false), (" --noise 0.002", true)] {
        let _ = fs::remove_file(dir.path().join("card.img"));
        run(dir.path(), &format!("sim {} --sd card.img{noise}", recording.display()), 0);
        let told = text(&run(dir.path(), "info --verify card.img", 0));
        let words = "of no frame came over the line, before the recorder: no damage of the log";
        assert_eq!(
            (told.contains(words), told.contains("1 session: everything holds")),
            (is_told, true),
            "{told}"
        );
    }
}
