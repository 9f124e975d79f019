//! Folders of the repository.

use std::path::{Path, PathBuf};

/// A Cortex-M4 with FPU.
pub(crate) const FIRMWARE_TARGET: &str = "thumbv7em-none-eabihf";

/// WebAssembly with files.
pub(crate) const BROWSER_TARGET: &str = "wasm32-wasip1";

pub(crate) fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("xtask is one folder below the root")
}

/// Cargo's, or the user's.
pub(crate) fn target() -> PathBuf {
    let chosen = std::env::var_os("CARGO_TARGET_DIR").filter(|dir| !dir.is_empty());
    chosen.map_or_else(|| root().join("target"), |dir| root().join(dir))
}

/// A path as typed from the root.
pub(crate) fn shown(path: &Path) -> String {
    path.strip_prefix(root()).unwrap_or(path).display().to_string()
}
