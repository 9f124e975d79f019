//! The `hums` program: everything is in the library, so that tests reach it.

use std::process::ExitCode;

fn main() -> ExitCode {
    hums::run(std::env::args_os())
}
