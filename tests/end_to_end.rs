//! The `hums` command and the image, from outside; each module is one step of `cargo xtask test`. One program: five took longer
//! to link than to run.
#![allow(clippy::unwrap_used, clippy::panic, reason = "a test fails by panicking")]

#[cfg(feature = "oracle")]
mod answer;
#[cfg(feature = "browser")]
mod browser;
#[cfg(feature = "chip")]
mod chip;
mod live;
mod sim;

/// In the list of ignored tests: an untested part is not a success.
#[cfg(not(feature = "chip"))]
#[test]
#[ignore = "comparisons with pymavlink, and the image on the model of its chip: `cargo xtask test` runs them"]
fn comparisons_with_pymavlink_and_the_image_on_the_model_of_its_chip() {}
