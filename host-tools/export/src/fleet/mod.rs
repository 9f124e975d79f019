//! A fleet's tables as files, by table, date and bucket of vehicles.
//!
//! ```text
//! FLEET/ATTITUDE/date=2026-11-21/bucket=07/s1a2b3c4d-3f0042000d51373435363338.parquet
//! FLEET/sessions/date=2026-11-21/bucket=07/s1a2b3c4d-3f0042000d51373435363338.parquet
//! FLEET/.hums-fleet/
//! ```
//!
//! The files of a session have the name of its recording, so the same recording twice is the same files. All files of a
//! session take their places in one transaction. The session's file in `sessions` tells that the session is there.

pub(crate) mod bucket;
pub mod compact;
pub mod overview;
pub(crate) mod sessions;
#[cfg(test)]
mod tests;
pub(crate) mod transaction;

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, DirEntry, File};
use std::io::{self, BufRead as _, BufReader};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use anyhow::{Context as _, Result, bail};
use sha2::{Digest as _, Sha256};

use crate::context::Context;
use crate::files::{Inputs, cannot_write, make_directory};
use crate::hex::hex;
use crate::outcome::exists;
use bucket::Bucket;
use transaction::{OWN, Transaction};

pub(crate) const SESSIONS: &str = "sessions";
const EXTENSION: &str = ".parquet";
/// Hive's word for "null", known to every reader of this layout.
const NO_DATE: &str = "__HIVE_DEFAULT_PARTITION__";

/// The bucket of a vehicle, from 0 to 15: the first hexadecimal digit of the SHA-256 of its name.
pub fn bucket(vehicle: &str) -> u8 {
    Sha256::digest(vehicle.as_bytes()).first().map_or(0, |byte| byte >> 4)
}

fn partition(vehicle: &str, date: Option<&str>) -> String {
    format!("date={}/bucket={:02}", date.unwrap_or(NO_DATE), bucket(vehicle))
}

fn file_name(session: &str, part: u32) -> String {
    match part {
        ..=1 => format!("{session}{EXTENSION}"),
        part => format!("{session}.{part}{EXTENSION}"),
    }
}

/// The session of a file of this name; `None` for the file of another program, or of several sessions.
fn session_of(name: &str) -> Option<&str> {
    let stem = name.strip_suffix(EXTENSION)?;
    let session = stem.split_once('.').map_or(stem, |(session, _)| session);
    let (short, unique) = session.split_once('-')?;
    let is_hex = |text: &str| text.bytes().all(|byte| matches!(byte, b'0'..=b'9' | b'a'..=b'f'));
    let number = short.strip_prefix(['s', 'r'])?;
    (number.len() == 8 && is_hex(number) && unique.len() == 24 && is_hex(unique)).then_some(session)
}

#[derive(Debug)]
pub(crate) struct Fleet {
    /// The folder of the tables, or of files that go to the bucket.
    root: PathBuf,
    bucket: Option<Bucket>,
    is_begun: Mutex<bool>,
    /// The number of frames of each session.
    written: Mutex<BTreeMap<String, u64>>,
}

enum Found {
    Alone(String),
    /// In a file of several sessions.
    Compacted,
}

impl Fleet {
    pub(crate) fn new(root: &Path, bucket: Option<Bucket>) -> Self {
        Self { root: root.to_owned(), bucket, is_begun: Mutex::default(), written: Mutex::default() }
    }

    fn shown(&self, place: &str) -> PathBuf {
        self.bucket.as_ref().map_or_else(|| self.root.join(place), |bucket| bucket.address.shown(place))
    }

    /// Once for each program.
    fn begin(&self, inputs: &Inputs) -> Result<()> {
        let mut is_begun = self.is_begun.lock().unwrap_or_else(PoisonError::into_inner);
        if !*is_begun {
            inputs.refuse(&self.root)?;
            make_directory(&self.root)?;
            match &self.bucket {
                Some(bucket) => bucket.begin()?,
                None => transaction::recover(&self.root)?,
            }
            *is_begun = true;
        }
        Ok(())
    }

    fn find(&self, session: &str) -> Result<Option<Found>> {
        if let Some(bucket) = &self.bucket {
            return bucket.find(session);
        }
        let name = file_name(session, 1);
        for date in folders(&self.root.join(SESSIONS))? {
            for bucket in folders(&self.root.join(SESSIONS).join(&date))? {
                let partition = format!("{date}/{bucket}");
                if self.root.join(SESSIONS).join(&partition).join(&name).exists() {
                    return Ok(Some(Found::Alone(partition)));
                }
            }
        }
        let index = self.root.join(OWN).join("compacted").join(shard(session));
        let file = match File::open(index) {
            Ok(file) => BufReader::new(file),
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(error.into()),
        };
        for line in file.lines() {
            if line? == session {
                return Ok(Some(Found::Compacted));
            }
        }
        Ok(None)
    }

    fn is_written(&self, session: &str) -> Option<u64> {
        self.written.lock().unwrap_or_else(PoisonError::into_inner).get(session).copied()
    }

    fn check(&self, session: &str, found: &Found, inputs: &Inputs) -> Result<()> {
        match found {
            Found::Compacted => {
                let why = format!("session {session} is in a file of several sessions, which stays as it is");
                Err(exists(&self.shown(SESSIONS), false).context(why))
            }
            Found::Alone(partition) if !inputs.may_replace() => {
                let path = format!("{SESSIONS}/{partition}/{}", file_name(session, 1));
                Err(exists(&self.shown(&path), inputs.can_replace()))
            }
            Found::Alone(_) => Ok(()),
        }
    }

    fn files(&self, session: &str, partition: &str) -> Result<BTreeSet<String>> {
        let mut files = BTreeSet::new();
        for table in folders(&self.root)? {
            for name in names(&self.root.join(&table).join(partition))? {
                if session_of(&name) == Some(session) {
                    files.insert(format!("{table}/{partition}/{name}"));
                }
            }
        }
        Ok(files)
    }
}

fn shard(session: &str) -> String {
    hex(&Sha256::digest(session.as_bytes())[..1])
}

pub(crate) fn names(folder: &Path) -> Result<Vec<String>> {
    names_of(folder, |_| true)
}

fn folders(folder: &Path) -> Result<Vec<String>> {
    let is_folder = |entry: &DirEntry| match entry.file_type() {
        Ok(kind) if !kind.is_symlink() => kind.is_dir(),
        _ => entry.path().is_dir(),
    };
    let names = names_of(folder, is_folder)?.into_iter();
    Ok(names.filter(|name| !name.starts_with('.')).collect())
}

fn names_of(folder: &Path, is_wanted: impl Fn(&DirEntry) -> bool) -> Result<Vec<String>> {
    let entries = match fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(error) if matches!(error.kind(), io::ErrorKind::NotFound | io::ErrorKind::NotADirectory) => {
            return Ok(Vec::new());
        }
        Err(error) => return Err(error).with_context(|| format!("{}: cannot be read", folder.display())),
    };
    let mut names = Vec::new();
    for entry in entries {
        let entry = entry.with_context(|| format!("{}: cannot be read", folder.display()))?;
        names.extend(entry.file_name().into_string().ok().filter(|_| is_wanted(&entry)));
    }
    names.sort_unstable();
    Ok(names)
}

/// What became of a session, with the paths of its files.
#[derive(Debug)]
pub(crate) enum Ended {
    Alone(Vec<PathBuf>),
    /// In place of a log with fewer frames, of the same call.
    Replaces(Vec<PathBuf>),
    /// Another log of the same call has more frames.
    Dropped,
}

pub(crate) struct Session {
    transaction: Transaction,
    root: PathBuf,
    partition: String,
    name: String,
}

impl Session {
    pub(crate) fn begin(context: &Context) -> Result<Self> {
        let Some(fleet) = &context.fleet else { bail!("the output of the tables is unknown") };
        let identity = &context.identity;
        fleet.begin(&context.inputs)?;
        let name = identity.recording.clone();
        if fleet.is_written(&name).is_none()
            && let Some(found) = fleet.find(&name)?
        {
            fleet.check(&name, &found, &context.inputs)?;
        }
        let partition = partition(&identity.vehicle, identity.date.as_deref());
        let root = fleet.shown("");
        Ok(Self { transaction: Transaction::begin(&fleet.root)?, root, partition, name })
    }

    fn place(&self, table: &str, part: u32) -> String {
        format!("{table}/{}/{}", self.partition, file_name(&self.name, part))
    }

    pub(crate) fn path(&self, table: &str, part: u32) -> PathBuf {
        self.root.join(self.place(table, part))
    }

    pub(crate) fn file(&self, table: &str, part: u32) -> Result<File> {
        let path = self.transaction.path(&self.place(table, part));
        let file = File::options().write(true).create_new(true).open(&path);
        file.with_context(|| cannot_write(&self.path(table, part)))
    }

    pub(crate) fn end_file(&self, file: File) -> Result<()> {
        self.transaction.end_file(file)
    }

    /// All files are there and closed: they take their places. Of two recordings of one session in one call the longer one
    /// stays.
    pub(crate) fn finish(self, context: &Context, frames: u64) -> Result<Ended> {
        let Some(fleet) = &context.fleet else { bail!("the output of the tables is unknown") };
        if let Some(bucket) = &fleet.bucket {
            return self.upload(fleet, bucket, context, frames);
        }
        let Self { transaction, name, .. } = self;
        let transaction = transaction.sync()?;
        let lock = transaction::lock(&fleet.root)?;
        let mut written = fleet.written.lock().unwrap_or_else(PoisonError::into_inner);
        let found = fleet.find(&name)?;
        match (written.get(&name), &found) {
            (Some(other), _) if *other >= frames => return Ok(Ended::Dropped),
            (None, Some(found)) => fleet.check(&name, found, &context.inputs)?,
            _ => {}
        }
        let replaced = match found {
            Some(Found::Alone(partition)) => fleet.files(&name, &partition)?,
            _ => BTreeSet::new(),
        };
        let files = transaction.commit(&lock, &replaced, &[])?;
        let other = written.insert(name, frames);
        Ok(if other.is_some() { Ended::Replaces(files) } else { Ended::Alone(files) })
    }

    /// [`Self::finish`] in object storage: no other program adds this session meanwhile.
    fn upload(self, fleet: &Fleet, bucket: &Bucket, context: &Context, frames: u64) -> Result<Ended> {
        let Self { transaction, root, partition, name } = self;
        let places = transaction.places()?;
        let lease = bucket.lease(&name, &places, None)?;
        let found = fleet.find(&name)?;
        let refused = match (fleet.is_written(&name), &found) {
            // Without its index it is gone, and the lease has its files.
            (Some(other), Some(_)) if other >= frames => Some(Ok(Ended::Dropped)),
            (None, Some(found)) => fleet.check(&name, found, &context.inputs).err().map(Err),
            (Some(_), Some(found @ Found::Compacted)) => {
                fleet.check(&name, found, &context.inputs).err().map(Err)
            }
            _ => None,
        };
        if let Some(refused) = refused {
            lease.end()?;
            return refused;
        }
        let files: Vec<(String, PathBuf)> =
            places.iter().map(|place| (place.clone(), transaction.path(place))).collect();
        let replaced =
            if let Some(Found::Alone(partition)) = &found { Some(partition.as_str()) } else { None };
        bucket.add(lease, &name, &partition, &files, replaced)?;
        let other = fleet.written.lock().unwrap_or_else(PoisonError::into_inner).insert(name, frames);
        let files = places.iter().map(|place| root.join(place)).collect();
        Ok(if other.is_some() { Ended::Replaces(files) } else { Ended::Alone(files) })
    }
}
