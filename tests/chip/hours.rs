//! Hours of flight in the model's time, for which `cargo xtask test` has no time.

use std::fs::{self, File};
use std::path::{Path, PathBuf};

use hums_sdcard::{Kind, Medium, Model};
use hums_tests::chip::record::{self, Session};
use hums_tests::chip::rig::heartbeat;
use hums_tests::chip::{self, BAUD};
use hums_tests::flights::own;
use hums_tests::program;
use sha2::{Digest as _, Sha256};
use stm32f405_model::machine::{Board, Machine};
use stm32f405_model::rcc::Cause;
use stm32f405_model::time::{MS, Ps, SECOND, US};

use super::flights::assert_verifies;
use super::{bench, ready};

/// Milliseconds.
const OFF_MS_MAX: u64 = 2;
const START: Ps = 2 * SECOND;

/// Milliseconds: the clock begins a moment after power-on, and the record cuts off to a millisecond.
fn off_ms(ended: &[Ps], recorded: &[(u64, Vec<u8>)]) -> u64 {
    let late = |(end, (ms, _)): (&Ps, &(u64, Vec<u8>))| (end / MS).cast_signed() - ms.cast_signed();
    let mut lates = ended.iter().zip(recorded).map(late);
    let first = lates.next().expect("a frame");
    lates.map(|late| late.abs_diff(first)).max().unwrap_or(0)
}

struct Flight {
    frames: Vec<(u64, Vec<u8>)>,
    lap: Ps,
}

impl Flight {
    fn of(name: &str) -> Self {
        let tlog = fs::read(own(name)).unwrap();
        let frames = chip::frames(&tlog);
        let first = frames[0].0;
        // Recordings' clocks never run backwards.
        let frames: Vec<_> = frames.into_iter().map(|(us, frame)| (us - first, frame.to_vec())).collect();
        let lap = frames.last().unwrap().0 * US + 3 * SECOND;
        Self { frames, lap }
    }

    fn frame(&self, number: usize) -> (Ps, &[u8]) {
        let (us, frame) = &self.frames[number % self.frames.len()];
        ((number / self.frames.len()) as u64 * self.lap + us * US, frame)
    }
}

struct Shelf(PathBuf);

impl Shelf {
    fn card(&self) -> PathBuf {
        self.0.join("card.img")
    }

    /// The shelf, also its number of power-ons of this length; a shelf of another image is emptied.
    fn look(image: &str, minutes: u64) -> (Self, u64) {
        let shelf = Self(Path::new(env!("CARGO_TARGET_TMPDIR")).join("hours"));
        let done = fs::read_to_string(shelf.0.join("done.txt")).unwrap_or_default();
        let done = done.strip_prefix(&format!("{image} {minutes} ")).and_then(|count| count.parse().ok());
        if done.is_none() {
            let _ = fs::remove_dir_all(&shelf.0);
        }
        (shelf, done.unwrap_or(0))
    }

    fn flash(&self) -> PathBuf {
        self.0.join("flash.bin")
    }

    fn keep(&self, image: &str, minutes: u64, done: u64, machine: &Machine, medium: &Medium) {
        fs::create_dir_all(&self.0).unwrap();
        fs::write(self.flash(), machine.chip.flash.content.all()).unwrap();
        let card = File::options().write(true).create(true).truncate(false).open(self.card()).unwrap();
        medium.save(&card).unwrap();
        fs::write(self.0.join("done.txt"), format!("{image} {minutes} {done}")).unwrap();
    }
}

fn number(name: &str, otherwise: u64) -> u64 {
    std::env::var(name).map_or(otherwise, |text| text.parse().unwrap())
}

/// `HUMS_CHIP_HOURS` of flight (3) in power-ons of `HUMS_CHIP_MINUTES` (180), on one board with one card. An
/// interrupted run continues.
#[test]
#[ignore = "three hours and more in the model's time (cargo xtask prove chip)"]
fn hours_of_flight_are_recorded_whole_and_at_their_times() {
    let (hours, minutes) = (number("HUMS_CHIP_HOURS", 3), number("HUMS_CHIP_MINUTES", 180));
    let bench = bench();
    let digest = Sha256::digest(fs::read(program::firmware()).unwrap());
    let image = digest.iter().map(|byte| format!("{byte:02x}")).collect::<Vec<_>>().concat();
    let (shelf, mut done) = Shelf::look(&image, minutes);
    println!("{done} power-ons of {minutes} min are done");
    while done * minutes < hours * 60 {
        let medium = match done {
            0 => Medium::formatted(chip::BLOCKS),
            _ => Medium::load(&File::open(shelf.card()).unwrap()).unwrap(),
        };
        let board = Board { seed: done + 1, ..Board::default() };
        let card = Model::new(Kind::Sdhc, medium.clone());
        let (mut machine, slot) = chip::board_of(bench.image.clone(), board, card);
        if done > 0 {
            let flash = fs::read(shelf.flash()).unwrap();
            machine.chip.flash.content.all_mut().copy_from_slice(&flash);
        }
        let flight = Flight::of(["ap_quad_guided.tlog", "px4_hil_quad_low.tlog"][done as usize % 2]);
        let ended = fly(&mut machine, &flight, START + minutes * 60 * SECOND);
        assert!(slot.violations().is_empty(), "{:?}", slot.violations());
        assert_recorded(&record::last(&medium).expect("a session"), &flight, &ended);
        done += 1;
        shelf.keep(&image, minutes, done, &machine, &medium);
        println!("{done} power-ons, {} min", done * minutes);
        assert_verifies(&shelf.card());
    }
}

#[track_caller]
fn fly(machine: &mut Machine, flight: &Flight, until: Ps) -> Vec<Ps> {
    let (mut ended, mut free) = (Vec::new(), 0);
    while machine.now() < until {
        let to = (machine.now() + 100 * MS).min(until);
        loop {
            let (at, frame) = flight.frame(ended.len());
            let at = (START + at).max(free);
            if at >= to {
                break;
            }
            free = machine.send(0, frame, at, BAUD);
            ended.push(free);
        }
        machine.run_until(to).unwrap();
        machine.take_sent(0);
        machine.take_sent(1);
        if to % (600 * SECOND) < 100 * MS {
            println!("{} min, {} frames", to / (60 * SECOND), ended.len());
        }
    }
    machine.run_until(until.max(free) + 2 * SECOND).unwrap();
    machine.power_off();
    assert!(machine.resets.iter().all(|(_, cause)| *cause == Cause::Power), "{:?}", machine.resets);
    ended
}

#[track_caller]
fn assert_recorded(session: &Session, flight: &Flight, ended: &[Ps]) {
    let Session { frames, losses, gaps, .. } = session;
    assert!(losses.is_empty() && *gaps == 0, "{losses:?}, {gaps} gaps");
    assert_eq!(frames.len(), ended.len(), "frames recorded, and sent");
    let wrong = frames.iter().enumerate().find(|(number, (_, frame))| *frame != flight.frame(*number).1);
    assert!(wrong.is_none(), "frame {wrong:?}");
    let off = off_ms(ended, frames);
    println!("{} frames, times off by {off} ms at the most", ended.len());
    assert!(off <= OFF_MS_MAX, "{off} ms");
}

/// Settings fill the store ten times in an hour, on the ground. In the silence after that an erase stops the
/// processor.
#[test]
#[ignore = "an hour in the model's time (cargo xtask prove chip)"]
fn the_records_time_is_the_senders_for_an_hour_with_ten_erases() {
    const ROUND: Ps = 360 * SECOND;
    let (mut rig, begin) = ready(Board::default());
    for round in 1..=10 {
        while rig.machine.chip.flash.erases.len() < round {
            rig.fill().unwrap();
            let silent = rig.machine.now() + 20 * SECOND;
            while rig.machine.chip.flash.erases.len() < round && rig.machine.now() < silent {
                rig.run_for(10 * MS, false).unwrap();
            }
            assert!(rig.machine.now() < begin + round as u64 * ROUND, "round {round} has no erase");
        }
        let (_, at, long) = *rig.machine.chip.flash.erases.last().unwrap();
        rig.run(at + long + 10 * MS, false).unwrap();
        let mut sequence = 0_u8;
        while rig.machine.now() < begin + round as u64 * ROUND {
            let now = rig.machine.now();
            sequence = sequence.wrapping_add(1);
            let beat = heartbeat(sequence);
            rig.sent.push((rig.machine.send(0, &beat, now, BAUD), beat));
            rig.run(now + 100 * MS, false).unwrap();
        }
        println!("{round} rounds, {} erases", rig.machine.chip.flash.erases.len());
    }
    rig.run(begin + 10 * ROUND + 2 * SECOND, false).unwrap();
    let session = rig.sessions().pop().unwrap();
    assert!(session.losses.is_empty(), "{:?}", session.losses);
    assert_eq!(session.frames.len(), rig.sent.len(), "frames recorded, and sent");
    let mut pairs = session.frames.iter().zip(&rig.sent);
    assert_eq!(pairs.find(|((_, recorded), (_, sent))| recorded != sent), None);
    let ended: Vec<Ps> = rig.sent.iter().map(|(at, _)| *at).collect();
    let off = off_ms(&ended, &session.frames);
    println!("{} frames, {} erases: off by {off} ms", ended.len(), rig.machine.chip.flash.erases.len());
    assert!(off <= OFF_MS_MAX, "{off} ms");
}
