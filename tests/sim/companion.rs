//! The box as a companion, against a ground station of pymavlink's.
#![cfg(feature = "oracle")]

use std::fs;
use std::io::ErrorKind;
use std::net::UdpSocket;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::time::{Duration, Instant};

use hums_tests::flights::own;
use hums_tests::oracle;
use hums_tests::program::{self, hums};
use serde_json::Value;
use tempfile::TempDir;

/// `hums sim` in real time, with a ground station's port.
struct Board {
    dir: Option<TempDir>,
    child: Child,
    port: u16,
}

impl Board {
    fn start(flags: &[&str]) -> Self {
        Self::start_in(tempfile::tempdir().unwrap(), flags)
    }

    /// On the card that lies in `dir`, if one does.
    fn start_in(dir: TempDir, flags: &[&str]) -> Self {
        // Free a moment ago: the next one to ask gets another.
        let port = UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        let mut command: Command = program::command(["sim", "--json", "--speed", "real", "--input"]);
        command.arg(own("ap_quad_guided.tlog")).arg("--sd").arg(dir.path().join("card.img"));
        command.args(["--gs", &format!("udpin:127.0.0.1:{port}")]).args(flags);
        let child = command.stdin(Stdio::null()).stdout(Stdio::null()).spawn().unwrap();
        Self { dir: Some(dir), child, port }
    }

    /// Ends it in order, as Ctrl-C does, and gives everything that its log holds, a line each.
    fn end(self) -> String {
        let dir = self.switch_off();
        let image = dir.path().join("card.img");
        let command = ["decode".as_ref(), image.as_os_str(), "-o".as_ref(), "-".as_ref()];
        hums(command.into_iter().chain(["--format".as_ref(), "jsonl".as_ref()])).expect_code(&[0]).text()
    }

    /// Ends it, and leaves the folder with its card and its store.
    fn switch_off(mut self) -> TempDir {
        let kill = Command::new("kill").args(["-INT", &self.child.id().to_string()]).status().unwrap();
        assert!(kill.success());
        let start = Instant::now();
        while self.child.try_wait().unwrap().is_none() {
            assert!(start.elapsed() < Duration::from_secs(30), "it does not end");
            std::thread::sleep(Duration::from_millis(20));
        }
        self.dir.take().expect("it is switched off once")
    }
}

impl Drop for Board {
    fn drop(&mut self) {
        // Only one that is still running, after a failure, takes notice.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[test]
fn a_ground_station_lists_reads_sets_and_commands() {
    let board = Board::start(&[]);
    let said = oracle::companion(board.port);
    let log = board.end();

    assert_eq!(said["heartbeat"], serde_json::json!([1, 18, 8]), "system, type, autopilot: {said}");
    let names: Vec<&str> = said["names"].as_array().unwrap().iter().filter_map(Value::as_str).collect();
    assert!(names.contains(&"GS_BUDGET") && names.contains(&"BAT_REM_WARN"), "{said}");
    for list in ["listed", "listed_again"] {
        assert_eq!(said[list], said["count"], "{list}: {said}");
        assert_eq!(said["count"].as_u64(), Some(names.len() as u64));
    }
    assert_eq!((&said["read"], &said["read_at_0"]), (&2000.0.into(), &0.into()));
    assert_eq!((&said["set"], &said["set_as_integer"]), (&22.0.into(), &9.0.into()), "{said}");
    for kept in ["refused", "refused_nan", "after"] {
        assert_eq!(said[kept], 22.0, "{kept}: the value that counts: {said}");
    }
    // MAV_RESULT: 0 accepted, 3 unsupported.
    assert_eq!(said["unsupported"], 3);
    for accepted in ["version_ack", "stop", "record"] {
        assert_eq!(said[accepted], 0, "{accepted}: {said}");
    }
    // COMMAND_INT, FTP, MAVLink 2, C_CAST.
    assert_eq!(said["capabilities"], 8 | 32 | 8_192 | 131_072);
    assert_eq!(said["protocol"], 200);
    assert_eq!(said["for_the_autopilot"], Value::Null, "that is not ours to answer");

    for recorded in ["BAT_REM_WARN", "recording stopped by 255/190", "recording started by 255/190"] {
        assert!(log.contains(recorded), "the record does not tell: {recorded}");
    }
}

#[test]
fn once_there_is_a_key_only_what_is_signed_with_it_and_new_does_anything_also_after_power_off() {
    let dir = tempfile::tempdir().unwrap();
    let (params, store, state) =
        (dir.path().join("params.txt"), dir.path().join("store"), dir.path().join("state"));
    fs::write(&params, "GS_BUDGET 5000\nSIGN_PORT 1\nGS_SIGN 2\n").unwrap();
    let (params, store) = (params.display().to_string(), store.display().to_string());

    let board = Board::start_in(dir, &["--params", &params, "--store", &store]);
    let first = oracle::signing(board.port, &state);
    let dir = board.switch_off();
    assert_eq!((&first["before"], &first["plain"]["signed"]), (&20.0.into(), &0.into()), "{first}");
    assert_eq!(first["key"], "HUMS: signing key set", "{first}");

    let board = Board::start_in(dir, &["--store", &store]);
    let second = oracle::signing(board.port, &state);
    let dir = board.switch_off();
    assert_eq!(second["replayed_after_power_off"], serde_json::json!([24.0]), "{second}");
    assert_eq!(second["stamps_go_on"], true, "{second}");

    for (said, stays) in [(&first, 20.0), (&second, 24.0)] {
        let sealed = &said["sealed"];
        assert!(sealed["signed"].as_u64() > Some(3), "{said}");
        assert_eq!(sealed["good"], sealed["signed"], "{said}");
        assert_eq!([&sealed["unsigned"], &sealed["wrong"], &sealed["bad"]], [0, 0, 0], "{said}");
        assert_eq!((&sealed["rises"], &said["unsigned_list"]), (&true.into(), &true.into()), "{said}");
        // MAV_RESULT 2 is denied.
        assert_eq!((&said["unsigned_set"], &said["unsigned_command"]), (&stays.into(), &2.into()), "{said}");
        assert_eq!((&said["signed_set"], &said["signed_command"]), (&21.0.into(), &true.into()), "{said}");
        assert_eq!(said["wrong_key"], serde_json::json!([23.0]), "{said}");
        assert_eq!(said["replayed"], serde_json::json!([23.0, 23.0]), "{said}");
        assert_eq!(said["after"], 24.0, "{said}");
    }
    // The key is on the card in no form.
    let card = fs::read(dir.path().join("card.img")).unwrap();
    let key: Vec<u8> = (1..33).collect();
    assert!(!card.windows(key.len()).any(|bytes| bytes == key), "the key is on the card");
}

/// A UDP link that loses every tenth datagram, each way.
struct Lossy {
    port: u16,
    lost: Arc<AtomicU32>,
    over: Arc<AtomicBool>,
}

impl Lossy {
    fn to(board: u16) -> Self {
        let (lost, over) = (Arc::new(AtomicU32::new(0)), Arc::new(AtomicBool::new(false)));
        let client = UdpSocket::bind("127.0.0.1:0").unwrap();
        let port = client.local_addr().unwrap().port();
        let server = UdpSocket::bind("127.0.0.1:0").unwrap();
        server.connect(("127.0.0.1", board)).unwrap();
        let (counted, ended) = (Arc::clone(&lost), Arc::clone(&over));
        std::thread::spawn(move || {
            for socket in [&client, &server] {
                socket.set_read_timeout(Some(Duration::from_millis(1))).unwrap();
            }
            let (mut peer, mut random, mut buffer) = (None, 7_u32, [0; 2048]);
            let mut loses = || {
                random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                let loses = random >> 16 & 0xff < 26;
                counted.fetch_add(u32::from(loses), Ordering::Relaxed);
                loses
            };
            while !ended.load(Ordering::Relaxed) {
                match client.recv_from(&mut buffer) {
                    Ok((count, from)) => {
                        peer = Some(from);
                        if !loses() {
                            let _ = server.send(&buffer[..count]);
                        }
                    }
                    Err(error) => {
                        assert!(matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut));
                    }
                }
                if let (Ok(count), Some(peer)) = (server.recv(&mut buffer), peer)
                    && !loses()
                {
                    let _ = client.send_to(&buffer[..count], peer);
                }
            }
        });
        Self { port, lost, over }
    }
}

impl Drop for Lossy {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
    }
}

/// A card with one finished session on it, of some seconds.
fn card_with_a_log() -> (TempDir, Vec<u8>) {
    let dir = tempfile::tempdir().unwrap();
    let recording = fs::read(own("ap_quad_signed.raw")).unwrap();
    fs::write(dir.path().join("short.raw"), &recording[..80_000]).unwrap();
    fs::write(dir.path().join("params.txt"), "GS_BUDGET 5000\n").unwrap();
    let (input, image) = (dir.path().join("short.raw"), dir.path().join("card.img"));
    hums(["sim".as_ref(), "--input".as_ref(), input.as_os_str(), "--sd".as_ref(), image.as_os_str()])
        .expect_code(&[0]);
    // What is downloaded is the part of the file that was recorded.
    let card = fs::read(&image).unwrap();
    (dir, card)
}

/// The log is on the card as it was downloaded, whole and in one row.
#[track_caller]
fn assert_on_card(log: &Path, card: &[u8]) {
    let log = fs::read(log).unwrap();
    assert!(log.len() > 8_000 && log.len().is_multiple_of(512), "{} bytes", log.len());
    let first = card.chunks_exact(512).position(|block| block == &log[..512]).expect("its first sector");
    assert!(card[first * 512..].starts_with(&log), "the download differs from the card");
}

#[test]
fn a_log_pulled_over_a_link_that_loses_a_tenth_is_the_one_on_the_card() {
    let (dir, card) = card_with_a_log();
    let params = dir.path().join("params.txt").display().to_string();
    let (pulled, downloaded) = (dir.path().join("pulled"), dir.path().join("downloaded"));
    let board = Board::start_in(dir, &["--params", &params]);
    let link = Lossy::to(board.port);
    let address = format!("udpout:127.0.0.1:{}", link.port);
    let output = pulled.to_str().unwrap();
    let log = "00001_00.HUM";
    hums(["pull", "--link", &address, "-o", output, log]).expect_code(&[0]);
    assert!(link.lost.load(Ordering::Relaxed) > 5, "nothing was lost: {:?}", link.lost);
    assert_on_card(&pulled.join(log), &card);
    // Again: what is there is left.
    let again = hums(["pull", "--link", &address, "-o", output, log]).expect_code(&[0]);
    assert!(again.stderr.contains("00001_00.HUM: is there already"), "{}", again.stderr);

    let said = oracle::log_download(board.port, &downloaded, 0.1);
    assert_eq!(said["missing"], 0, "{said}");
    assert!(said["requests"].as_u64() > Some(1), "nothing was lost: {said}");
    assert_on_card(&downloaded, &card);
}

#[test]
fn the_command_line_lists_reads_and_sets_parameters_over_a_bad_link() {
    let board = Board::start(&[]);
    let link = Lossy::to(board.port);
    let address = format!("udpout:127.0.0.1:{}", link.port);
    let list = hums(["params", "list", "--link", &address]).expect_code(&[0]).text();
    assert!(list.contains("GS_BUDGET 2000\n") && list.contains("BAT_REM_WARN 15\n"), "{list}");
    let set = hums(["params", "set", "BAT_REM_WARN", "21.5", "--link", &address]).expect_code(&[0]).text();
    assert_eq!(set, "BAT_REM_WARN 21.5\n");
    let got = hums(["params", "get", "BAT_REM_WARN", "--link", &address]).expect_code(&[0]).text();
    assert_eq!(got, "BAT_REM_WARN 21.5\n");
    let refused = hums(["params", "set", "BAT_REM_WARN", "1000", "--link", &address]).expect_code(&[1]);
    assert!(refused.stderr.contains("keeps 21.5"), "{}", refused.stderr);
}
