//! `hums compact`: the files of many sessions become few files, sorted by vehicle and session.
//!
//! All tables of a date and bucket are one change (a transaction), so a session is never in both
//! kinds of files. Columns have the encoding that makes them smallest in a sample.

mod column;

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context as _, Result, bail};
use parquet::basic::{Compression, GzipLevel};
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::file::reader::{FileReader as _, SerializedFileReader};
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::printer::print_schema;
use parquet::schema::types::TypePtr;
use sha2::{Digest as _, Sha256};

use super::bucket::Bucket;
use super::transaction::{self, OWN, Transaction};
use super::{EXTENSION, SESSIONS, folders, names, session_of};
use crate::args::Compact;
use crate::hex::hex;
use crate::logs::in_order::{in_order, workers};
use crate::outcome::{Outcome, usage};
use crate::output;
use crate::plural::count;
use crate::printable::word;
use crate::storage::Address;
use column::Input;

const PREFIX: &str = "compact-";
/// A larger file of several sessions stays as it is, and new sessions go into a further one.
const LARGE_BYTES: u64 = 256 << 20;
/// Values of a column of a row group at most: a column is in memory as a whole. A row of a column of lists has many values.
const GROUP_VALUES: usize = 256 * 1024;
const AT_ONCE: usize = 4;

#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sum {
    files: u64,
    bytes: u64,
    new_files: u64,
    new_bytes: u64,
    pub(super) sessions: u64,
}

impl Sum {
    pub(super) fn add(&mut self, part: Self) {
        self.files += part.files;
        self.bytes += part.bytes;
        self.new_files += part.new_files;
        self.new_bytes += part.new_bytes;
        self.sessions += part.sessions;
    }
}

pub(super) fn no_tables(shown: &str) -> anyhow::Error {
    usage(format!("{shown}: has no tables of hums; hums decode --format parquet writes them"))
}

/// Whether a file of this name and size is of several sessions, and has room for more.
pub(super) fn is_compacted(name: &str, bytes: u64) -> bool {
    name.starts_with(PREFIX) && name.ends_with(EXTENSION) && bytes < LARGE_BYTES
}

/// Runs `hums compact`.
pub fn run(args: &Compact) -> Result<Outcome> {
    let mut failures = 0;
    let mut failed = |partition: &str, error: &anyhow::Error| {
        failures += 1;
        note!("{partition}: {error:#}; its files stay as they are");
    };
    let (sum, partitions) = match Address::of(&args.folder)? {
        Some(address) => Bucket::open(&address)?.compact(&mut failed)?,
        None => in_folder(&args.folder, &mut failed)?,
    };
    output::line(&word(&format!(
        "{}: {} in {}, {} bytes, from {}, {} bytes",
        args.folder.display(),
        count(sum.sessions, "session"),
        count(sum.new_files, "file"),
        sum.new_bytes,
        count(sum.files, "file"),
        sum.bytes
    )))?;
    if failures > 0 {
        bail!("{failures} of {} could not be compacted", count(partitions as u64, "partition"));
    }
    Ok(Outcome::Done)
}

fn in_folder(root: &Path, failed: &mut dyn FnMut(&str, &anyhow::Error)) -> Result<(Sum, usize)> {
    if !root.join(OWN).is_dir() {
        return Err(no_tables(&root.display().to_string()));
    }
    let mut partitions = BTreeSet::new();
    let tables = folders(root)?;
    for table in &tables {
        for date in folders(&root.join(table))? {
            let buckets = folders(&root.join(table).join(&date))?;
            partitions.extend(buckets.into_iter().map(|bucket| format!("{date}/{bucket}")));
        }
    }
    let mut sum = Sum::default();
    for partition in &partitions {
        match of_partition(root, &tables, partition) {
            Ok(part) => sum.add(part),
            Err(error) => failed(partition, &error),
        }
    }
    let parts =
        names(&root.join(OWN))?.into_iter().filter(|name| name.ends_with(transaction::PART)).count() as u64;
    if parts > 0 {
        note!(
            "{}: {} of runs that did not end; if no hums runs there, they can be deleted",
            root.join(OWN).display(),
            count(parts, "folder")
        );
    }
    Ok((sum, partitions.len()))
}

fn of_partition(root: &Path, tables: &[String], partition: &str) -> Result<Sum> {
    let lock = transaction::lock(root)?;
    let Some(merged) = merged(root, tables, partition)? else { return Ok(Sum::default()) };
    merged.transaction.sync()?.commit(&lock, &merged.replaced, &merged.sessions)?;
    Ok(merged.sum)
}

/// New files of a date and bucket, which do not count yet.
pub(super) struct MergedFiles {
    pub(super) transaction: Transaction,
    pub(super) replaced: BTreeSet<String>,
    sessions: Vec<String>,
    pub(super) sum: Sum,
}

/// `None` without a session that has files of its own.
pub(super) fn merged(root: &Path, tables: &[String], partition: &str) -> Result<Option<MergedFiles>> {
    let (mut work, mut new) = (Vec::new(), BTreeSet::new());
    for table in tables {
        let folder = root.join(table).join(partition);
        let (mut paths, mut has_new) = (Vec::new(), false);
        for name in names(&folder)? {
            let path = folder.join(&name);
            let is_of_hums = name.starts_with(PREFIX) && name.ends_with(EXTENSION);
            match session_of(&name) {
                Some(session) if path.is_file() => {
                    has_new = true;
                    if table == SESSIONS {
                        new.insert(session.to_owned());
                    }
                    paths.push(path);
                }
                None if is_of_hums => {
                    if is_compacted(&name, fs::metadata(&path)?.len()) {
                        paths.push(path);
                    }
                }
                _ => note!("{}: is not of hums, and stays as it is", path.display()),
            }
        }
        if has_new {
            work.push((table.as_str(), paths));
        }
    }
    if work.is_empty() {
        return Ok(None);
    }
    let transaction = Transaction::begin(root)?;
    let mut sum = Sum { sessions: new.len() as u64, ..Sum::default() };
    let mut replaced = BTreeSet::new();
    for path in work.iter().flat_map(|(_, paths)| paths) {
        sum.files += 1;
        sum.bytes += fs::metadata(path)?.len();
        let place = path.strip_prefix(root).unwrap_or(path).components();
        let place: Vec<_> = place.map(|part| part.as_os_str().to_string_lossy()).collect();
        replaced.insert(place.join("/"));
    }
    let mut work = work.into_iter();
    in_order(
        workers(),
        AT_ONCE,
        || Ok(work.next()),
        |(table, paths)| of_table(&transaction, &format!("{table}/{partition}"), &paths),
        |made| {
            let (files, bytes) = made?;
            sum.new_files += files;
            sum.new_bytes += bytes;
            Ok(())
        },
    )?;
    Ok(Some(MergedFiles { transaction, replaced, sessions: new.into_iter().collect(), sum }))
}

/// Writes one file for each set of columns. Returns the number of files and their bytes.
fn of_table(transaction: &Transaction, place: &str, paths: &[PathBuf]) -> Result<(u64, u64)> {
    let mut by_schema: BTreeMap<String, Vec<Input>> = BTreeMap::new();
    for path in paths {
        let input = Input::open(path)?;
        let mut schema = Vec::new();
        print_schema(&mut schema, &input.schema());
        by_schema.entry(String::from_utf8_lossy(&schema).into_owned()).or_default().push(input);
    }
    let mut sum = (0, 0);
    for (schema, inputs) in by_schema {
        let mut hash = Sha256::new();
        hash.update(&schema);
        for segment in inputs.iter().flat_map(Input::segments) {
            hash.update(&segment.session);
            hash.update(segment.rows.to_le_bytes());
        }
        let name = format!("{PREFIX}{}{EXTENSION}", hex(&hash.finalize()[..12]));
        let path = transaction.path(&format!("{place}/{name}"));
        let (rows, file) = merge(&inputs, &path).with_context(|| place.to_owned())?;
        let expected: usize = inputs.iter().map(Input::rows).sum();
        let written = SerializedFileReader::new(File::open(&path)?)?.metadata().file_metadata().num_rows();
        if rows != expected || written != expected as i64 {
            bail!(
                "{place}: only {written} of {expected} rows were written, so the old files stay; try again"
            );
        }
        sum = (sum.0 + 1, sum.1 + file.metadata()?.len());
        transaction.end_file(file)?;
    }
    Ok(sum)
}

/// The input's index, the first row, the number of rows.
pub(super) type Rows = (usize, usize, usize);

fn groups(inputs: &[Input]) -> Vec<Vec<Rows>> {
    let mut segments: Vec<_> = inputs
        .iter()
        .enumerate()
        .flat_map(|(index, input)| input.segments().iter().map(move |segment| (segment, index)))
        .collect();
    segments.sort_by_key(|(segment, _)| (&segment.vehicle, &segment.session, segment.part, segment.from));
    cut(segments.into_iter().map(|(segment, index)| {
        let width = inputs.get(index).map_or(1, Input::values_of_row);
        ((index, segment.from, segment.rows), width)
    }))
}

/// Cuts rows into row groups. The second number is the number of values of a row, at least 1.
pub(super) fn cut(segments: impl Iterator<Item = (Rows, usize)>) -> Vec<Vec<Rows>> {
    let (mut groups, mut group, mut room) = (Vec::new(), Vec::new(), GROUP_VALUES);
    for ((index, mut from, mut left), width) in segments {
        while left > 0 {
            if room < width && !group.is_empty() {
                groups.push(std::mem::take(&mut group));
                room = GROUP_VALUES;
            }
            let rows = left.min((room / width).max(1));
            group.push((index, from, rows));
            (from, left, room) = (from + rows, left - rows, room.saturating_sub(rows * width));
        }
    }
    groups.extend(Some(group).filter(|group| !group.is_empty()));
    groups
}

fn merge(inputs: &[Input], path: &Path) -> Result<(usize, File)> {
    let groups = groups(inputs);
    let (Some(first), Some(group)) = (inputs.first(), groups.first()) else { bail!("no file has a row") };
    let schema: TypePtr = Arc::new(first.schema());
    let mut properties = base();
    for column in 0..first.columns() {
        properties = column::read(inputs, group, column)?.encoded(&schema, column, properties)?;
    }
    let is_of_session = |known: &&KeyValue| !known.key.starts_with("hums.");
    let about = first.about().iter().filter(is_of_session).cloned().collect();
    let properties = properties.set_key_value_metadata(Some(about)).build();
    let mut writer = SerializedFileWriter::new(File::create_new(path)?, schema, Arc::new(properties))?;
    let mut rows = 0;
    for group in &groups {
        let mut to = writer.next_row_group()?;
        let mut column = 0;
        while let Some(mut writer) = to.next_column()? {
            column::read(inputs, group, column)?.write(&mut writer)?;
            writer.close()?;
            column += 1;
        }
        to.close()?;
        rows += group.iter().map(|(_, _, rows)| rows).sum::<usize>();
    }
    Ok((rows, writer.into_inner()?))
}

fn base() -> parquet::file::properties::WriterPropertiesBuilder {
    WriterProperties::builder()
        .set_compression(Compression::GZIP(GzipLevel::default()))
        .set_dictionary_enabled(false)
        .set_statistics_enabled(EnabledStatistics::Chunk)
        .set_offset_index_disabled(true)
        .set_created_by(concat!("hums ", env!("CARGO_PKG_VERSION")).to_owned())
}
