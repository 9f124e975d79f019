//! A register model of the STM32F405 round the model of its processor.
#![forbid(unsafe_code)]

pub mod access;
pub mod art;
pub mod bits;
pub mod chip;
pub mod dma;
pub mod flash;
pub mod gpio;
pub mod image;
pub mod line;
pub mod machine;
pub mod map;
pub mod memory;
pub mod otg;
pub mod pwr;
pub mod rcc;
pub mod report;
#[cfg(test)]
mod scripts;
mod serve;
pub mod small;
pub mod spi;
pub mod tim;
pub mod tim11;
pub mod time;
pub mod usart;
