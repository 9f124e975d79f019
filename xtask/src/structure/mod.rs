//! `cargo xtask structure`: the house as it stands, read from the code itself.
//!
//! Every file of every crate is parsed ([`source`]), every path that its code names is followed to the file that
//! defines what is named ([`resolve`]), and of these imports one picture is drawn ([`picture`]) and some counts are
//! printed ([`counts`]). A circle of imports is an error: two files that need each other are one file, or the thing
//! that both need has no file yet. Tests do not count: they may know everything.
//!
//! `docs/modules.dot` is the picture in words, `docs/modules.svg` is it drawn by Graphviz. The first is held against
//! the code by `cargo xtask test`, so that the picture cannot grow old.

mod counts;
mod picture;
mod resolve;
mod source;

use std::fs;

use anyhow::{Context as _, Result, bail};

use crate::repo;
use crate::setup::{self, Need};
use crate::shell::Shell;

const DOT: &str = "docs/modules.dot";
const SVG: &str = "docs/modules.svg";

/// Draws the picture anew and prints the counts.
pub(crate) fn draw() -> Result<()> {
    setup::ensure(&[Need::Graphviz], false).require_all()?;
    let crates = source::read_workspace()?;
    let imports = resolve::imports(&crates);
    fs::write(repo::root().join(DOT), picture::dot(&crates, &imports)).context(DOT)?;
    Shell::new("dot").args(["-Tsvg", "-o", SVG, DOT]).run()?;
    println!("{}", counts::table(&crates));
    println!("picture               {SVG}");
    no_circle(&crates, &imports)
}

/// As a step of the tests: no circle, and the picture is of this code.
pub(crate) fn check() -> Result<()> {
    let crates = source::read_workspace()?;
    let imports = resolve::imports(&crates);
    no_circle(&crates, &imports)?;
    let stands = fs::read_to_string(repo::root().join(DOT)).unwrap_or_default();
    if stands != picture::dot(&crates, &imports) {
        bail!("{DOT} is not of this code any more: `cargo xtask structure` draws it anew");
    }
    println!("{}", counts::table(&crates));
    Ok(())
}

fn no_circle(crates: &[source::Crate], imports: &[resolve::Import]) -> Result<()> {
    let circles = resolve::circles(crates, imports);
    if circles.is_empty() {
        return Ok(());
    }
    bail!("imports go in a circle:\n  {}", circles.join("\n\n  "));
}
