//! Lists the board files of this folder, so that the crate has their text.

use std::fmt::Write as _;
use std::path::PathBuf;
use std::{env, fs};

fn main() {
    let folder = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").expect("cargo sets it"));
    println!("cargo::rerun-if-changed={}", folder.display());
    let entries = fs::read_dir(&folder).expect("the crate's folder");
    let mut names: Vec<String> = entries
        .filter_map(|entry| {
            entry.ok()?.file_name().into_string().ok()?.strip_suffix(".toml").map(str::to_owned)
        })
        .filter(|name| name != "Cargo")
        .collect();
    names.sort_unstable();
    let mut list = "&[\n".to_owned();
    for name in names {
        let path = folder.join(format!("{name}.toml"));
        let _ = writeln!(list, "({name:?}, include_str!({:?})),", path.display().to_string());
    }
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets it")).join("files.rs");
    fs::write(out, list + "]\n").expect("OUT_DIR can be written");
}
