//! Recording: what goes in comes out, and what cannot is counted.

use std::fs;
use std::io::Write;
use std::net::{TcpListener, UdpSocket};

use crate::support::{attempt, frames, frames_of, hums, json, px4, recorded, run};

#[test]
fn a_flight_comes_back_frame_for_frame() {
    let dir = recorded();
    run(dir.path(), "decode card.img -o back.tlog --format tlog", 0);
    let back = fs::read(dir.path().join("back.tlog")).expect("decoded");
    assert_eq!(frames(&back), frames_of(&px4()));
}

#[test]
fn a_run_repeats_to_the_byte_and_its_counters_add_up() {
    let dir = tempfile::tempdir().expect("directory");
    let faults = "--noise 0.001 --stall 700@20 --write-error 0.001 --seed 5";
    let first = run(dir.path(), &format!("sim --input PX4 --sd a.img --gs a.gs --json {faults}"), 0);
    let second = run(dir.path(), &format!("sim --input PX4 --sd b.img --gs b.gs --json {faults}"), 0);
    assert_eq!(first.stdout, second.stdout);
    let read = |name: &str| fs::read(dir.path().join(name)).expect(name);
    assert!(read("a.img") == read("b.img"), "the cards differ");
    assert!(read("a.gs") == read("b.gs"), "the GS streams differ");
    let json = json(&first);
    let number = |key: &str| json[key].as_u64().expect(key);
    assert_eq!(number("frames_in"), number("frames_logged") + number("frames_lost"));
    assert_eq!(number("gs_bytes"), read("a.gs").len() as u64);
    // A write begins at the latest 200 ms after the card stands still.
    assert!((500..=750).contains(&number("sd_stall_ms_max")), "{json}");
    assert!(number("bytes_not_frames") > 0, "{json}");
    assert!(number("queue_bytes_max") <= number("queue_bytes_capacity"));
}

#[test]
fn the_tap_shows_what_the_uart_got() {
    let dir = tempfile::tempdir().expect("directory");
    run(dir.path(), "sim --input PX4 --sd card.img --tap clean.bin", 0);
    let clean = fs::read(dir.path().join("clean.bin")).expect("tap");
    assert_eq!(clean, frames_of(&px4()).concat());
    run(dir.path(), "sim --input PX4 --sd card2.img --tap noisy.bin --noise 0.01", 0);
    let noisy = fs::read(dir.path().join("noisy.bin")).expect("tap");
    let damaged = clean.iter().zip(&noisy).filter(|(a, b)| a != b).count();
    assert!((clean.len() / 200..clean.len() / 50).contains(&damaged), "{damaged} of {}", clean.len());
}

#[test]
fn a_second_run_adds_a_session_and_leaves_the_first_one() {
    let dir = recorded();
    let output = run(dir.path(), "sim --input PX4 --sd card.img --json", 0);
    assert_eq!(json(&output)["log_files"], serde_json::json!(["00002_00.HUM"]));
    let info = json(&run(dir.path(), "info card.img --json", 0));
    let counts: Vec<_> = (0..2).map(|log| info["logs"][log]["frames"].as_u64()).collect();
    assert_eq!(counts, [Some(16_645), Some(16_645)]);
}

#[test]
fn a_power_cut_costs_what_was_in_memory_and_nothing_else() {
    let dir = tempfile::tempdir().expect("directory");
    for cut in ["1000", "1001:torn", "1500", "1603:torn"] {
        let _ = fs::remove_file(dir.path().join("card.img"));
        let output =
            attempt(dir.path(), &format!("sim --input PX4 --sd card.img --json --cut-after-writes {cut}"));
        let json = json(&output);
        assert_eq!(json["power_cut"], true);
        let lost = json["frames_lost"].as_u64().expect("frames_lost");
        assert!(lost < 60, "cut {cut}: {json}");
        assert_eq!(output.status.code(), Some(if lost == 0 { 0 } else { 3 }), "cut {cut}: {json}");
        let code = if cut.contains("torn") { 3 } else { 0 };
        run(dir.path(), "decode card.img -o back.tlog --format tlog", code);
        let back = frames(&fs::read(dir.path().join("back.tlog")).expect("decoded"));
        assert_eq!(Some(back.len() as u64), json["frames_logged"].as_u64());
        assert!(frames_of(&px4()).starts_with(&back), "cut {cut}: what is there is not what came");
    }
}

#[test]
fn a_card_that_is_away_costs_a_counted_loss_and_comes_back() {
    let dir = tempfile::tempdir().expect("directory");
    let json = json(&run(dir.path(), "sim --input PX4 --sd card.img --json --card-out 30..120", 3));
    let lost = json["frames_lost"].as_u64().expect("frames_lost");
    let logged = json["frames_logged"].as_u64().expect("frames_logged");
    assert!(lost > 0 && logged > 10_000 && lost + logged == 16_645, "{json}");
    run(dir.path(), "decode card.img -o back.tlog --format tlog", 3);
    let back = frames(&fs::read(dir.path().join("back.tlog")).expect("decoded"));
    assert_eq!(back.len() as u64, logged);
}

#[test]
fn a_card_that_never_comes_back_holds_what_the_counters_say() {
    let dir = tempfile::tempdir().expect("directory");
    let json = json(&run(dir.path(), "sim --input PX4 --sd card.img --json --card-out 60..", 3));
    run(dir.path(), "decode card.img -o back.tlog --format tlog", 0);
    let back = frames(&fs::read(dir.path().join("back.tlog")).expect("decoded"));
    assert_eq!(json["frames_logged"].as_u64(), Some(back.len() as u64));
    assert_eq!(json["frames_lost"].as_u64(), Some(16_645 - back.len() as u64));
    assert!(json["findings"].to_string().contains("recording"), "a stopped recorder is told: {json}");
}

#[test]
fn a_reboot_is_a_new_session_on_the_same_card() {
    let dir = tempfile::tempdir().expect("directory");
    let output = run(dir.path(), "sim --input PX4 --sd card.img --json --reboot-at 100 --reboot-at 200", 3);
    let json = json(&output);
    assert_eq!(json["log_files"].as_array().map(Vec::len), Some(3), "{json}");
    assert!(json["frames_lost"].as_u64().is_some_and(|lost| lost < 60), "{json}");
    assert_eq!(json["frames_in"], 16_645);
}

#[test]
fn a_card_that_is_no_card_loses_everything_and_says_so() {
    let dir = tempfile::tempdir().expect("directory");
    let path = dir.path().join("card.img");
    fs::write(&path, vec![0x5a; 1 << 20]).expect("written");
    let json = json(&run(dir.path(), "sim --input PX4 --sd card.img --json", 3));
    assert_eq!((json["frames_logged"].as_u64(), json["frames_lost"].as_u64()), (Some(0), Some(16_645)));
    assert_eq!(fs::read(&path).expect("read"), vec![0x5a; 1 << 20], "a foreign card was written to");
}

#[test]
fn the_recorded_times_can_be_ignored() {
    let dir = tempfile::tempdir().expect("directory");
    run(dir.path(), "sim --input PX4 --sd card.img --line-rate 115200", 0);
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
    command.current_dir(dir.path()).args(["sim", "--input", "-", "--sd", "card.img", "--gs", "-"]);
    let output = command.write_stdin(raw).output().expect("it runs");
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
    let line = format!("sim --input tcp:{address} --sd card.img --gs udpout:{sink} --json");
    let json = json(&run(dir.path(), &line, 0));
    sender.join().expect("the server");
    // A frame in two pieces that this machine reads 20 ms apart, because others keep it busy, is none: as on a UART.
    let frames = json["frames_in"].as_u64().expect("a count");
    assert!((1990..=2000).contains(&frames), "{frames} of 2000 frames");
    let mut datagram = [0; 2048];
    // The first, empty one only says where to answer.
    assert_eq!(ground.recv(&mut datagram).expect("a datagram"), 0);
    assert!(ground.recv(&mut datagram).is_ok_and(|got| got > 8), "nothing reached the ground station");
}

#[test]
fn parameters_come_from_a_file_and_slips_in_it_are_told() {
    let dir = tempfile::tempdir().expect("directory");
    let params = |text: &str| fs::write(dir.path().join("p.param"), text).expect("written");
    params("# limits\nGPS_SATS_WARN 30\nVIBE_WARN,25.5\n");
    let output = run(dir.path(), "sim --input PX4 --sd a.img --params p.param --json", 0);
    let findings = json(&output)["findings"].to_string();
    assert!(findings.contains("satellites"), "30 satellites are wanted: {findings}");
    for wrong in ["NO_SUCH_NAME 1", "VIBE_WARN", "VIBE_WARN x", "VIBE_WARN 1e9", "VIBE_WARN 1 2"] {
        params(wrong);
        let output = run(dir.path(), "sim --input PX4 --sd b.img --params p.param", 2);
        assert!(String::from_utf8_lossy(&output.stderr).contains("line 1"), "{wrong}");
    }
    assert!(!dir.path().join("b.img").exists(), "a slip left an image behind");
}
