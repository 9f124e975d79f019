//! Writes the stored form of this build's layout table to standard output: a further file for `layouts/`.

use std::io::Write;

fn main() -> std::io::Result<()> {
    let mut stored = Vec::new();
    hums_blackbox::layouts::store(|bytes| stored.extend_from_slice(bytes));
    std::io::stdout().write_all(&stored)
}
