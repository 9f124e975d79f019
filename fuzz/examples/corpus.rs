//! Writes the inputs of the corpus that our own code makes: `cargo run -p hums-fuzz --example corpus`.

use std::fs;
use std::path::Path;

use anyhow::{Context as _, Result};

fn main() -> Result<()> {
    let corpus = Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus");
    for (target, name, bytes) in hums_fuzz::corpus::inputs() {
        let folder = corpus.join(target);
        fs::create_dir_all(&folder).with_context(|| folder.display().to_string())?;
        let path = folder.join(name);
        fs::write(&path, &bytes).with_context(|| path.display().to_string())?;
    }
    Ok(())
}
