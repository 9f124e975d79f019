//! `hums-check.html`: the check and the report in a browser, one file with the program inside.
//!
//! The program is `hums-browser`, built for WASI, compressed and in base64. Its policy allows no connection.

use std::io::{self, ErrorKind, Write as _};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD as BASE64;
use flate2::Compression;
use flate2::write::GzEncoder;

use crate::page::program::{STYLE, UPLOT, program};
use crate::report::page::{fill, policy};

pub(crate) const TEMPLATE: &str = include_str!("page/assets/check.html");

/// The page opens within a second or two; a phone's flash is no faster than this.
const PAGE_BYTES_MAX: usize = 6_000_000;

/// The page with this program (WebAssembly).
///
/// # Errors
/// It has more than 6,000,000 bytes.
pub fn page(wasm: &[u8]) -> io::Result<String> {
    let mut compressed = GzEncoder::new(Vec::new(), Compression::best());
    compressed.write_all(wasm)?;
    let (own, worker) = (program("check"), program("worker"));
    // The reports run in frames of this page, under its policy.
    let scripts = policy(&[&own, UPLOT, &program("report"), &program("compare")]);
    let page = fill(
        TEMPLATE,
        &[
            ("{{scripts}}", &scripts),
            ("{{style}}", &STYLE.concat()),
            ("{{version}}", env!("CARGO_PKG_VERSION")),
            ("{{worker}}", &worker),
            ("{{wasm}}", &BASE64.encode(compressed.finish()?)),
            ("{{program}}", &own),
        ],
    );
    if page.len() > PAGE_BYTES_MAX {
        let words = format!("the page has {} bytes; at most {PAGE_BYTES_MAX} open at once", page.len());
        return Err(io::Error::new(ErrorKind::FileTooLarge, words));
    }
    Ok(page)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_that_opens_slowly_is_refused() {
        // A program without any pattern: xorshift64.
        let next = |x: &u64| [x ^ x << 13].map(|x| x ^ x >> 7).map(|x| x ^ x << 17).first().copied();
        let noise: Vec<u8> =
            std::iter::successors(Some(1), next).take(625_000).flat_map(u64::to_le_bytes).collect();
        let words = page(&noise).map_err(|error| error.to_string()).expect_err("it is too large");
        assert!(words.contains("at most 6000000 open at once"), "{words}");
        assert!(page(&noise[..100_000]).is_ok());
    }
}
