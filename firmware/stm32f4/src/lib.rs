//! The registers of the STM32F405 that application and resident program use alike.
#![no_std]

pub mod flash;
pub mod pins;
pub mod supply;
pub mod watchdog;
pub mod words;
