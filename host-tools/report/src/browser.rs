//! `hums-check.html`: the check and the report in a browser, one file with the program inside.
//!
//! The program is `hums-browser`, built for WASI, compressed and in base64. Its policy allows no connection.

use std::io::{self, Write as _};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD as BASE64;
use flate2::Compression;
use flate2::write::GzEncoder;

use crate::page::program::{STYLE, UPLOT, program};
use crate::report::page::{fill, policy};

const TEMPLATE: &str = include_str!("page/assets/check.html");

/// The page with this program (WebAssembly).
pub fn page(wasm: &[u8]) -> io::Result<String> {
    let mut compressed = GzEncoder::new(Vec::new(), Compression::best());
    compressed.write_all(wasm)?;
    let (own, worker) = (program("check"), program("worker"));
    // The reports run in frames of this page, under its policy.
    let scripts = policy(&[&own, UPLOT, &program("report"), &program("compare")]);
    Ok(fill(
        TEMPLATE,
        &[
            ("{{scripts}}", &scripts),
            ("{{style}}", &STYLE.concat()),
            ("{{version}}", env!("CARGO_PKG_VERSION")),
            ("{{worker}}", &worker),
            ("{{wasm}}", &BASE64.encode(compressed.finish()?)),
            ("{{program}}", &own),
        ],
    ))
}
