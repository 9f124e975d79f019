//! Makes `hums-check.html` of the program: `hums-check-page PROGRAM.wasm OUT.html`.

use std::fs;

use anyhow::{Context as _, Result, bail};

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [program, page] = arguments.as_slice() else { bail!("usage: hums-check-page PROGRAM.wasm OUT.html") };
    let wasm = fs::read(program).with_context(|| format!("{program}: cannot be read"))?;
    fs::write(page, hums_report::browser::page(&wasm)?).with_context(|| format!("{page}: cannot be written"))
}
