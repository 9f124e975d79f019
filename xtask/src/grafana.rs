//! `cargo xtask grafana`: each database's dashboards, of one description.

use std::fs;

use anyhow::{Context as _, Result};

use crate::repo;

#[path = "../../host-tools/grafana/resolve.rs"]
mod resolve;

/// Dashboards beside the data sources, for `compose.yaml`.
pub(crate) fn write() -> Result<()> {
    let folder = repo::root().join("host-tools/grafana");
    for name in ["flight.json", "health.json"] {
        let description = serde_json::from_slice(&fs::read(folder.join(name))?).context(name)?;
        for database in resolve::DATABASES {
            let dashboard = resolve::resolve(&description, database)
                .context("the dashboard is not a JSON object; mend the file")?;
            let path = folder.join(database.0).join(name);
            fs::write(&path, serde_json::to_string_pretty(&dashboard)?)?;
            println!("{}", repo::shown(&path));
        }
    }
    Ok(())
}
