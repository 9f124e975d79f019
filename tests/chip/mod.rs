//! The image that is flashed, byte for byte, on the model of its chip (`docs/chip.md`). Times and loads are modelled,
//! not measured. The feature `chip` enables these tests: `cargo xtask test` turns it on, and builds the image.

#[cfg(feature = "chip")]
mod boards;
#[cfg(feature = "chip")]
mod bounds;
#[cfg(feature = "chip")]
mod faults;
#[cfg(feature = "chip")]
mod flights;
#[cfg(feature = "chip")]
mod hours;
#[cfg(feature = "chip")]
mod images;
#[cfg(feature = "chip")]
mod memory;
#[cfg(feature = "chip")]
mod persistence;
#[cfg(feature = "chip")]
mod power;
#[cfg(feature = "chip")]
mod program;
#[cfg(feature = "chip")]
mod recompute;
#[cfg(feature = "chip")]
mod update;
#[cfg(feature = "chip")]
mod usb;

/// In the list of ignored tests: an untested part is not a success.
#[cfg(not(feature = "chip"))]
#[test]
#[ignore = "the image on the model of its chip: `cargo xtask test` runs it"]
fn the_image_on_the_model_of_its_chip() {}

#[cfg(feature = "chip")]
fn bench() -> hums_tests::chip::rig::Bench {
    bench_of(&hums_tests::program::firmware())
}

#[cfg(feature = "chip")]
fn bench_of(image: &std::path::Path) -> hums_tests::chip::rig::Bench {
    use hums_tests::{chip, flights};

    let file = std::fs::read(image).unwrap_or_else(|why| panic!("{}: {why}", image.display()));
    let image = stm32f405_model::image::Image::parse(&file).unwrap();
    let tlog = std::fs::read(flights::own("px4_hil_quad_low.tlog")).unwrap();
    let frames = chip::frames(&tlog).into_iter().map(|(_, frame)| frame.to_vec()).collect();
    chip::rig::Bench { image, frames }
}

/// Bytes that `budgets.toml` allows.
#[cfg(feature = "chip")]
fn budget(table: &str, name: &str) -> u32 {
    let budgets: toml::Table = include_str!("../../budgets.toml").parse().unwrap();
    budgets[table][name]["bytes_max"].as_integer().unwrap() as u32
}
