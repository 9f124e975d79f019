//! The SD card as the host tools see it: an image file as a block device.

pub mod faults;
pub mod image;
pub mod sim;

pub use faults::Faults;
pub use image::{ReadOnlyImage, length};
pub use sim::SimCard;
