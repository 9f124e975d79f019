//! `hums pull`: interrupted, gone on with, and never made of two logs.

use std::fs;
use std::io::{BufRead as _, BufReader};
use std::net::UdpSocket;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use hums_tests::flights::own;
use hums_tests::frames;
use hums_tests::live::Running;
use hums_tests::program::{command, hums};
use tempfile::TempDir;

use crate::board::{Board, assert_on_card};

const LOG: &str = "00001_00.HUM";

/// A card with one finished session on it: this part of a recording. All such cards have logs of the same names.
fn card(part: std::ops::Range<usize>, seed: &str) -> (TempDir, Vec<u8>) {
    let dir = tempfile::tempdir().unwrap();
    let recording = fs::read(own("ap_quad_signed.raw")).unwrap();
    let (input, image) = (dir.path().join("short.raw"), dir.path().join("card.img"));
    fs::write(&input, &recording[part]).unwrap();
    fs::write(dir.path().join("params.txt"), "GS_BUDGET 5000\n").unwrap();
    let mut sim = command(["sim", "--seed", seed, "--input"]);
    sim.arg(&input).arg("--sd").arg(&image);
    hums_tests::child::run(&mut sim, Duration::from_mins(1)).expect_code(&[0]);
    let card = fs::read(&image).unwrap();
    (dir, card)
}

fn board(dir: TempDir) -> Board {
    let params = dir.path().join("params.txt").display().to_string();
    Board::start_in(dir, &["--params", &params])
}

fn pull(board: &Board, output: &Path, names: &[&str]) -> hums_tests::child::Outcome {
    let address = format!("udpout:127.0.0.1:{}", board.port);
    let flags = ["pull", "--link", &address, "-o", output.to_str().unwrap()];
    hums(flags.into_iter().chain(names.iter().copied()))
}

/// Begins to pull and is killed when something has come.
fn begin(board: &Board, output: &Path) -> PathBuf {
    let address = format!("udpout:127.0.0.1:{}", board.port);
    let mut pull = command(["pull", "--link", &address, LOG, "-o"]);
    let mut child = pull.arg(output).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
    let words = BufReader::new(child.stderr.take().unwrap()).lines().map_while(Result::ok);
    let mut pull = Running(child);
    let came = words.into_iter().find(|line| line.contains(" bytes")).expect("something comes");
    pull.signal("KILL");
    pull.end(Duration::from_secs(5));
    let part = output.join(format!(".{LOG}.pull.hums-part"));
    assert!(part.metadata().unwrap().len() > 5_000 && !output.join(LOG).exists(), "{came}");
    part
}

#[test]
fn two_cards_are_never_made_into_one_log() {
    let ((one, one_card), (other, other_card)) = (card(0..90_000, "1"), card(60_000..150_000, "2"));
    let home = tempfile::tempdir().unwrap();
    let output = home.path().join("logs");

    // Interrupted; then another card is in the box.
    let first = board(one);
    let part = begin(&first, &output);
    let kept = fs::read(&part).unwrap();
    let one = first.switch_off();
    let second = board(other);
    let told = pull(&second, &output, &[LOG]).expect_code(&[0]).stderr;
    assert!(told.contains("is of another log of this name, or was changed; it begins anew"), "{told}");
    assert_on_card(&output.join(LOG), &other_card);
    let whole = fs::read(output.join(LOG)).unwrap();

    // Back to the first card: what is there is not replaced, whatever its length.
    second.switch_off();
    let first = board(one);
    for length in [whole.len(), 10_000] {
        fs::write(output.join(LOG), &whole[..length]).unwrap();
        let told = pull(&first, &output, &[LOG]).expect_code(&[1]).stderr;
        assert!(told.contains("another log of the same name") && told.contains("-o"), "{told}");
        assert_eq!(fs::read(output.join(LOG)).unwrap(), &whole[..length]);
    }

    // Where it had got to, it goes on.
    let apart = home.path().join("apart");
    fs::create_dir(&apart).unwrap();
    fs::write(apart.join(format!(".{LOG}.pull.hums-part")), &kept).unwrap();
    let told = pull(&first, &apart, &[LOG]).expect_code(&[0]).stderr;
    assert!(told.contains(&format!("goes on after {} bytes", kept.len())), "{told}");
    assert_on_card(&apart.join(LOG), &one_card);
    let told = pull(&first, &apart, &[LOG]).expect_code(&[0]).stderr;
    assert!(told.contains("is there already"), "{told}");

    // One bit of it is another one: it is no other card's.
    let log = apart.join(LOG);
    let mut spoiled = fs::read(&log).unwrap();
    spoiled[600] ^= 1;
    fs::write(&log, &spoiled).unwrap();
    let told = pull(&first, &apart, &[LOG]).expect_code(&[1]).stderr;
    assert!(told.contains("differs from the board's log (the same session)"), "{told}");
    spoiled[600] ^= 1;

    // All of it, and something behind it.
    fs::write(&log, [&spoiled[..], &[0; 5]].concat()).unwrap();
    let told = pull(&first, &apart, &[LOG]).expect_code(&[1]).stderr;
    assert!(told.contains("begins as the board's log, and has 5 bytes more than that has"), "{told}");
    assert_eq!(fs::read(&log).unwrap().len(), spoiled.len() + 5);

    // The same length, and one byte that is another one.
    let middle = spoiled.len() / 2;
    spoiled[middle] ^= 1;
    fs::write(&log, &spoiled).unwrap();
    pull(&first, &apart, &[LOG]).expect_code(&[1]);
    assert_eq!(fs::read(&log).unwrap(), spoiled, "it may be evidence of something");
}

#[test]
fn a_log_in_work_that_has_grown_is_completed() {
    let (dir, _) = card(0..80_000, "1");
    let board = board(dir);
    let home = tempfile::tempdir().unwrap();
    let log = home.path().join("00002_00.HUM");
    let name = ["00002_00.HUM"];
    let start = Instant::now();
    let first = loop {
        pull(&board, home.path(), &name).expect_code(&[0]);
        if let Ok(first) = fs::read(&log) {
            break first;
        }
        assert!(start.elapsed() < Duration::from_secs(30), "nothing is recorded");
        std::thread::sleep(Duration::from_millis(500));
    };
    std::thread::sleep(Duration::from_secs(5));
    let told = pull(&board, home.path(), &name).expect_code(&[0]).stderr;
    assert!(told.contains(&format!("goes on after {} bytes", first.len())), "{told}");
    let second = fs::read(&log).unwrap();
    assert!(second.len() > first.len() && second.starts_with(&first));
    let dir = board.switch_off();
    assert_on_card(&log, &fs::read(dir.path().join("card.img")).unwrap());
}

/// Between a client and a board, as if the board's firmware did not know `CalcFileCRC32`: the client's opcode 14 reaches the
/// board as one that nobody knows, and the refusal of that comes back as a refusal of opcode 14. Gives its port.
fn without_checksums(board: u16) -> u16 {
    const OPCODE: usize = 10 + 3 + 3;
    const OF: usize = OPCODE + 2;
    let (client, board_side) =
        (UdpSocket::bind("127.0.0.1:0").unwrap(), UdpSocket::bind("127.0.0.1:0").unwrap());
    board_side.connect(("127.0.0.1", board)).unwrap();
    let port = client.local_addr().unwrap().port();
    let (to_client, to_board) = (client.try_clone().unwrap(), board_side.try_clone().unwrap());
    let asks = Arc::new(Mutex::new(None));
    let answers = Arc::clone(&asks);
    // Both end with the test's program.
    std::thread::spawn(move || {
        let mut buffer = [0; 2048];
        while let Ok((length, from)) = client.recv_from(&mut buffer) {
            *asks.lock().unwrap() = Some(from);
            exchange(&mut buffer[..length], OPCODE, 14, 200);
            let _ = to_board.send(&buffer[..length]);
        }
    });
    std::thread::spawn(move || {
        let mut buffer = [0; 2048];
        // An error is a board that is not there yet.
        loop {
            let Ok(length) = board_side.recv(&mut buffer) else { continue };
            exchange(&mut buffer[..length], OF, 200, 14);
            if let Some(from) = *answers.lock().unwrap() {
                let _ = to_client.send_to(&buffer[..length], from);
            }
        }
    });
    port
}

/// In each `FILE_TRANSFER_PROTOCOL` of a datagram: this byte, where it has this value, gets that one.
fn exchange(datagram: &mut [u8], place: usize, from: u8, to: u8) {
    const ID: [u8; 3] = [110, 0, 0];
    const SEED: u8 = 84;
    let mut at = 0;
    while let Some([0xFD, length, ..]) = datagram.get(at..) {
        let end = 10 + usize::from(*length);
        let Some(frame) = datagram.get_mut(at..at + end + 2) else { return };
        if frame[7..10] == ID && end > place && frame[place] == from {
            frame[place] = to;
            let sum = frames::checksum(&frame[1..end], SEED).to_le_bytes();
            frame[end..].copy_from_slice(&sum);
        }
        at += end + 2;
    }
}

#[test]
fn a_board_that_computes_no_checksum_is_read_whole_and_what_its_sectors_say_counts() {
    let (dir, card) = card(0..30_000, "1");
    let board = board(dir);
    let port = without_checksums(board.port);
    let home = tempfile::tempdir().unwrap();
    let output = home.path().join("logs");
    let pull = || {
        let address = format!("udpout:127.0.0.1:{port}");
        hums(["pull", "--link", &address, LOG, "-o", output.to_str().unwrap()])
    };
    // What a kill has left before anything came is of no other log.
    fs::create_dir(&output).unwrap();
    let part = output.join(format!(".{LOG}.pull.hums-part"));
    fs::write(&part, "").unwrap();
    let told = pull().expect_code(&[0]).stderr;
    assert!(
        told.contains("the board's firmware computes no checksum") && !told.contains("another log"),
        "{told}"
    );
    assert_on_card(&output.join(LOG), &card);

    // It goes on with what has the same ends; that its middle was changed, the sectors tell.
    let whole = fs::read(output.join(LOG)).unwrap();
    fs::remove_file(output.join(LOG)).unwrap();
    let mut begun = whole[..whole.len() - 1024].to_vec();
    let middle = begun.len() / 2 + 100;
    begun[middle] ^= 1;
    fs::write(&part, &begun).unwrap();
    let told = pull().expect_code(&[3]).stderr;
    assert!(told.contains(&format!("goes on after {} bytes", begun.len())), "{told}");
    assert!(told.contains("damaged sectors: 1"), "{told}");
}
