//! The image that is flashed, byte for byte, on the model of its chip (`docs/chip.md`). Times and loads are modelled,
//! not measured. The feature `chip` enables these tests: `cargo xtask test` turns it on, and builds the image.

mod boards;
mod bounds;
mod faults;
mod flights;
mod hours;
mod images;
mod memory;
mod persistence;
mod power;
mod program;
mod recompute;
mod update;
mod usb;

use hums_tests::chip::record::Compared;
use hums_tests::chip::rig::{Bench, Rig};
use stm32f405_model::machine::Board;
use stm32f405_model::time::{Ps, SECOND};

fn bench() -> Bench {
    bench_of(&hums_tests::program::firmware())
}

fn bench_of(image: &std::path::Path) -> Bench {
    use hums_tests::{chip, flights};

    let file = std::fs::read(image).unwrap_or_else(|why| panic!("{}: {why}", image.display()));
    let image = stm32f405_model::image::Image::parse(&file).unwrap();
    let tlog = std::fs::read(flights::own("px4_hil_quad_low.tlog")).unwrap();
    let frames = chip::frames(&tlog).into_iter().map(|(_, frame)| frame.to_vec()).collect();
    Bench { image, frames }
}

/// A board whose store exists, and the time: a second after power-on.
fn ready(parts: Board) -> (Rig, Ps) {
    let mut rig = bench().settled(parts).unwrap();
    let begin = rig.machine.now() + SECOND;
    rig.run(begin, false).unwrap();
    (rig, begin)
}

#[track_caller]
fn assert_all_recorded(rig: &Rig) {
    let wanted = Compared { right: rig.sent.len(), ends: (0, 0), ..Compared::default() };
    assert_eq!(rig.compared(), wanted);
}

/// In what the ground station's port sent since the last call.
#[track_caller]
fn assert_heard(rig: &mut Rig, told: &str) {
    let heard: Vec<u8> = rig.machine.take_sent(1).into_iter().map(|(_, byte)| byte).collect();
    assert!(String::from_utf8_lossy(&heard).contains(told), "the ground station never heard «{told}»");
}

/// Bytes that `budgets.toml` allows.
fn budget(table: &str, name: &str) -> u32 {
    let budgets: toml::Table = include_str!("../../budgets.toml").parse().unwrap();
    budgets[table][name]["bytes_max"].as_integer().unwrap() as u32
}
