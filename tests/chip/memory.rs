//! Memory that changes by itself: altered frames are left out and reported, and recording goes on.

use std::collections::BTreeMap;

use anyhow::Result;
use hums::logs::on_card;
use hums::logs::reader::{EntryCollector, GroupReceiver, read};
use hums_blackbox::record::Record;
use hums_blackbox::{Entry, Gap};
use hums_tests::chip;
use hums_tests::chip::record::{Compared, compare};
use hums_tests::chip::rig::Rig;
use hums_tests::damage::Random;
use stm32f405_model::machine::Board;
use stm32f405_model::report::Report;
use stm32f405_model::time::{MS, Ps, SECOND};

use super::ready;

#[derive(Debug, Default)]
struct Read {
    frames: Vec<Vec<u8>>,
    notes: BTreeMap<String, usize>,
    /// By cause.
    gaps: BTreeMap<&'static str, usize>,
}

/// A group's entries.
#[derive(Default)]
struct Group(Read);

impl EntryCollector for Group {
    fn entry(&mut self, entry: &Entry<'_>) {
        match entry {
            Entry::Frame { bytes, .. } => self.0.frames.push(bytes.to_vec()),
            Entry::Record { record: Record::Note(note), .. } => {
                *self.0.notes.entry(note.text.to_owned()).or_default() += 1;
            }
            Entry::Record { .. } => {}
        }
    }

    fn held_bytes(&self) -> usize {
        0
    }
}

impl GroupReceiver<Group> for Read {
    fn gap(&mut self, gap: &Gap) -> Result<()> {
        *self.gaps.entry(gap.cause.name()).or_default() += 1;
        Ok(())
    }

    fn group(&mut self, Group(read): Group) -> Result<()> {
        self.frames.extend(read.frames);
        for (text, count) in read.notes {
            *self.notes.entry(text).or_default() += count;
        }
        Ok(())
    }
}

/// Results of flips.
struct Outcome {
    compared: Compared,
    read: Read,
    /// Beside those of power.
    resets: usize,
    /// Number of flips.
    flips: u64,
    stopped: Option<Box<Report>>,
}

fn flipped(part: &str, most: u64, apart: Ps, seed: u64) -> Outcome {
    let (mut rig, _) = ready(Board { seed, ..Board::default() });
    let mut flips = 0;
    let stopped = flip(&mut rig, part, most, apart, &mut Random::new(seed), &mut flips).err();
    let dir = tempfile::tempdir().unwrap();
    let card = dir.path().join("card.img");
    chip::save(&rig.medium, &card).unwrap();
    let mut found = Read::default();
    for log in on_card(&card) {
        read(&log, Group::default, &mut found, |_| {}).unwrap();
    }
    let sent: Vec<Vec<u8>> = rig.sent.iter().map(|(_, frame)| frame.clone()).collect();
    let compared = compare(&sent, found.frames.iter().map(Vec::as_slice));
    // The first two are power's.
    Outcome { compared, read: found, resets: rig.machine.resets.len() - 2, flips, stopped }
}

fn flip(
    rig: &mut Rig,
    part: &str,
    most: u64,
    apart: Ps,
    random: &mut Random,
    flips: &mut u64,
) -> Result<(), Box<Report>> {
    let symbol = rig.machine.image().find(part).expect("a static variable of the image's");
    let (address, bytes) = (symbol.address, symbol.bytes);
    while *flips < most {
        let now = rig.machine.now();
        rig.run(now + apart / 2 + random.below(apart), true)?;
        let (at, bit) = (random.below(u64::from(bytes)) as u32, random.below(8));
        rig.machine.poke(address + at, |byte| byte ^ 1 << bit);
        *flips += 1;
    }
    let now = rig.machine.now();
    rig.run(now + SECOND, true)?;
    rig.run(now + 4 * SECOND, false)
}

#[test]
fn flips_in_the_codecs_memory_give_no_wrong_frame() {
    let Outcome { compared, read, resets, stopped, .. } = flipped("WRITER", 30, 100 * MS, 5);
    println!("{compared:?}, gaps {:?}, notes {:?}, {resets} resets", read.gaps, read.notes);
    assert!(stopped.is_none(), "{stopped:?}");
    assert_eq!(compared.wrong, 0);
    let told: usize = read.gaps.values().sum();
    assert!(told > 0, "no flip had an effect: this has tried nothing");
    assert!(compared.right > 1_000, "{compared:?}");
}

fn five_thousand_in(part: &str, first: u64) {
    let (mut made, mut right, mut gaps, mut resets, mut stops) = (0, 0, 0, 0, 0);
    for seed in (first..).step_by(10) {
        let outcome = flipped(part, 100, 200 * MS, seed);
        println!(
            "{part} {seed}: {} flips, {:?}, gaps {:?}, notes {:?}, {} resets",
            outcome.flips, outcome.compared, outcome.read.gaps, outcome.read.notes, outcome.resets
        );
        assert_eq!(outcome.compared.wrong, 0, "{part}, seed {seed}");
        if let Some(report) = outcome.stopped {
            println!("{report}");
            stops += 1;
        }
        made += outcome.flips;
        right += outcome.compared.right;
        gaps += outcome.read.gaps.values().sum::<usize>();
        resets += outcome.resets;
        if made >= 5_000 {
            break;
        }
    }
    println!(
        "{part}: {made} flips, {right} frames right, 0 wrong, {gaps} gaps told, {resets} resets, {stops} runs stopped"
    );
}

#[test]
#[ignore = "half of 10,000 flips on the model of the chip (cargo xtask prove chip)"]
fn ten_thousand_flips_give_no_wrong_frame_half_of_them_in_the_codec() {
    five_thousand_in("WRITER", 1);
}

#[test]
#[ignore = "half of 10,000 flips on the model of the chip (cargo xtask prove chip)"]
fn ten_thousand_flips_give_no_wrong_frame_half_of_them_in_the_queues() {
    five_thousand_in("QUEUES", 2);
}
