//! The processor against QEMU and the architecture's manual.

mod common;
mod decoding;
mod exceptions;
mod flow;
mod image;
mod steps;
mod work;
