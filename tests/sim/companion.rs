//! The box as a companion, against a ground station of pymavlink's.
#![cfg(feature = "oracle")]

use std::net::UdpSocket;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use hums_tests::flights::own;
use hums_tests::oracle;
use hums_tests::program::{self, hums};
use serde_json::Value;
use tempfile::TempDir;

/// `hums sim` in real time, with a ground station's port.
struct Board {
    dir: TempDir,
    child: Child,
    port: u16,
}

impl Board {
    fn start(flags: &[&str]) -> Self {
        let dir = tempfile::tempdir().unwrap();
        // Free a moment ago: the next one to ask gets another.
        let port = UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        let mut command: Command = program::command(["sim", "--json", "--speed", "real", "--input"]);
        command.arg(own("ap_quad_guided.tlog")).arg("--sd").arg(dir.path().join("card.img"));
        command.args(["--gs", &format!("udpin:127.0.0.1:{port}")]).args(flags);
        let child = command.stdin(Stdio::null()).stdout(Stdio::null()).spawn().unwrap();
        Self { dir, child, port }
    }

    /// Ends it in order, as Ctrl-C does, and gives everything that its log holds, a line each.
    fn end(mut self) -> String {
        let kill = Command::new("kill").args(["-INT", &self.child.id().to_string()]).status().unwrap();
        assert!(kill.success());
        let start = Instant::now();
        while self.child.try_wait().unwrap().is_none() {
            assert!(start.elapsed() < Duration::from_secs(30), "it does not end");
            std::thread::sleep(Duration::from_millis(20));
        }
        let image = self.dir.path().join("card.img");
        hums([
            "decode".as_ref(),
            image.as_os_str(),
            "-o".as_ref(),
            "-".as_ref(),
            "--format".as_ref(),
            "jsonl".as_ref(),
        ])
        .expect_code(&[0])
        .text()
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
