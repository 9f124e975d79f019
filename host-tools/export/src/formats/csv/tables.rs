//! The CSV tables of one log: a folder of files with a limited number open at once.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{BufWriter, Write as _};

use anyhow::Result;

use crate::files::{Folder, FolderFile, buffered, settle};
use crate::table::Table;
use crate::text::{columns, push_csv_text};

/// Tables that are open at once at most: a process has some hundred files.
const OPEN_MAX: usize = 256;

pub(crate) struct CsvTables {
    folder: Folder,
    open: BTreeMap<Table, BufWriter<FolderFile>>,
    /// Tables that have their header; not all of them are open.
    begun: BTreeSet<Table>,
    headers: BTreeMap<&'static str, Vec<&'static str>>,
}

impl CsvTables {
    pub(crate) fn new(folder: Folder) -> Self {
        Self { folder, open: BTreeMap::new(), begun: BTreeSet::new(), headers: BTreeMap::new() }
    }

    pub(crate) fn headers(&mut self, headers: &BTreeMap<&'static str, Vec<&'static str>>) {
        for (name, columns) in headers {
            self.headers.entry(name).or_insert_with(|| columns.clone());
        }
    }

    pub(crate) fn put(&mut self, table: Table, lines: &[u8]) -> Result<()> {
        let name = format!("{}.csv", table.name());
        let path = self.folder.path().join(&name);
        if let Some(file) = self.open.get_mut(&table) {
            return settle(file.write_all(lines), &path);
        }
        let mut file = if self.begun.contains(&table) {
            buffered(self.folder.file_again(&name)?)
        } else {
            let mut file = buffered(self.folder.file(&name)?);
            let own = match table {
                Table::Hums(name) => self.headers.get(name).map(Vec::as_slice).unwrap_or_default(),
                _ => &[],
            };
            settle(file.write_all(header(table, own).as_bytes()), &path)?;
            self.begun.insert(table);
            file
        };
        settle(file.write_all(lines), &path)?;
        if self.open.len() >= OPEN_MAX
            && let Some((closed, mut file)) = self.open.pop_last()
        {
            settle(file.flush(), &self.folder.path().join(closed.name()))?;
        }
        self.open.insert(table, file);
        Ok(())
    }

    /// Tables so far.
    pub(crate) fn count(&self) -> usize {
        self.begun.len()
    }

    pub(crate) fn finish(mut self) -> Result<()> {
        for (table, mut file) in std::mem::take(&mut self.open) {
            settle(file.flush(), &self.folder.path().join(table.name()))?;
        }
        self.folder.finish()
    }
}

fn cell(name: &str) -> String {
    let mut out = Vec::new();
    push_csv_text(&mut out, name.as_bytes());
    String::from_utf8_lossy(&out).into_owned()
}

fn header(table: Table, own: &[&str]) -> String {
    let mut names: Vec<String> = vec!["time_boot[s]".into(), "time_utc".into()];
    match table {
        Table::Hums(_) => names.extend(own.iter().map(|name| cell(name))),
        Table::Message(id) => {
            names.extend(["system".into(), "component".into()]);
            names.extend(hums_dialect::message(id).map(columns).unwrap_or_default());
        }
        Table::Unverified(_) | Table::Unknown(_) => {
            names.extend(["system", "component", "sequence", "payload"].map(String::from));
        }
        Table::Unknowns => {
            names.extend(["system", "component", "id", "sequence", "payload"].map(String::from));
        }
    }
    names.join(",") + "\n"
}
