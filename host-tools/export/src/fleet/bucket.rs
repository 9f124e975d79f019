//! A fleet's tables in object storage, with the layout of a folder.
//!
//! Objects cannot be renamed, and a file system's locks do not exist. A program holds a *lease* instead: an object that it
//! writes if none is there, renews while it works, and deletes. A lease that is not renewed for [`PATIENCE`] is taken over
//! by a conditional write. A holder begins a request only with enough time left, so no request of it comes later.
//!
//! ```text
//! PREFIX/.hums-fleet/storage                  decode writes here
//! PREFIX/.hums-fleet/lease/SESSION            holder, and the places of the files that it adds
//! PREFIX/.hums-fleet/index/SESSION            date and bucket of a session that is complete
//! PREFIX/.hums-fleet/lease/DATE,BUCKET        holder, for compact and replaced sessions
//! PREFIX/.hums-fleet/commit/DATE,BUCKET       a change that counts: files that go, and files that come
//! PREFIX/.hums-fleet/new/DATE,BUCKET/...      files that come
//! ```
//!
//! A session's file in `sessions` is the last one to come, and the first one to go. If a program stops before, the lease
//! lists its files: the next program that adds the session replaces or deletes them. Compact leaves sessions with a lease.

#[cfg(test)]
mod tests;

use std::collections::BTreeSet;
use std::collections::hash_map::RandomState;
use std::fs;
use std::hash::{BuildHasher as _, Hasher as _};
use std::path::PathBuf;
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant, SystemTime};

use anyhow::{Context as _, Result, bail};

use super::compact::{self, Sum};
use super::transaction::{OWN, STORAGE};
use super::{Found, SESSIONS, file_name, session_of};
use crate::plural::count;
use crate::storage::{
    self, Address, COPIED_BYTES_MAX, DELETED_MAX, Object, Objects, REQUEST_S, Tag, When, each, is_inside,
};

/// A lease without a renewal for so long has no holder.
const PATIENCE: Duration = Duration::from_mins(3);
/// A lease of this age is renewed before the next request, as a fraction of [`PATIENCE`].
const RENEWALS: u32 = 6;
const _: () = assert!(PATIENCE.as_secs() > PATIENCE.as_secs() / RENEWALS as u64 + REQUEST_S);
/// A lease of others is looked at so often, as a fraction of [`PATIENCE`].
const LOOKS: u32 = 180;

/// The tables below an address.
pub(crate) struct Bucket {
    pub(super) address: Address,
    objects: Box<dyn Objects>,
    patience: Duration,
}

impl std::fmt::Debug for Bucket {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Bucket({})", self.address)
    }
}

fn own(folder: &str, name: &str) -> String {
    format!("{OWN}/{folder}/{}", name.replace('/', ","))
}

fn lines<'a>(lines: impl IntoIterator<Item = &'a String>) -> String {
    lines.into_iter().fold(String::new(), |text, line| text + line + "\n")
}

impl Bucket {
    pub(crate) fn open(address: &Address) -> Result<Self> {
        Ok(Self::with(address.clone(), storage::open(address)?, PATIENCE))
    }

    pub(super) fn with(address: Address, objects: Box<dyn Objects>, patience: Duration) -> Self {
        Self { address, objects, patience }
    }

    /// The tables are of `decode`, and begun changes are completed.
    pub(super) fn begin(&self) -> Result<()> {
        let mark = format!("{OWN}/{STORAGE}");
        if self.objects.get(&mark)?.is_none() {
            if !self.objects.folders(SESSIONS)?.is_empty() {
                bail!(
                    "{}: its tables were copied there, so hums cannot know all sessions; decode into another prefix",
                    self.address
                );
            }
            let is_written = |when| anyhow::Ok(self.objects.put(&mark, b"1\n".to_vec(), when)?.is_some());
            let wrong = "\"0123456789abcdef0123456789abcdef\"".to_owned();
            // The first and the last one must fail: without conditional writes two programs could add one session.
            if is_written(When::Is(&wrong))? || is_written(When::IsNew)? && is_written(When::IsNew)? {
                self.objects.delete(&[mark])?;
                bail!(
                    "{}: this server has no conditional writes (If-None-Match, If-Match); decode into a folder, and copy it",
                    self.address
                );
            }
        }
        self.recover()
    }

    /// Completes changes that count.
    fn recover(&self) -> Result<()> {
        self.last_names(&format!("{OWN}/commit"))?.iter().try_for_each(|name| self.finish(name))
    }

    fn finish(&self, name: &str) -> Result<()> {
        self.partition(name, None)?.end()
    }

    fn partition<'a>(&'a self, name: &str, outer: Option<&'a Lease<'a>>) -> Result<Lease<'a>> {
        let lease = self.lease(name, &[], outer)?;
        self.apply(&lease, name)?;
        Ok(lease)
    }

    fn last_names(&self, folder: &str) -> Result<Vec<String>> {
        let objects = self.objects.list(folder)?.into_iter();
        Ok(objects.filter_map(|object| Some(object.key.rsplit('/').next()?.to_owned())).collect())
    }

    /// Sessions with a lease, complete ones or the others: programs add or replace them, or were stopped.
    fn leased(&self, is_complete: bool) -> Result<Vec<String>> {
        let mut sessions = Vec::new();
        for name in self.last_names(&format!("{OWN}/lease"))? {
            if session_of(&file_name(&name, 1)).is_some() && self.is_complete(&name)? == is_complete {
                sessions.push(name);
            }
        }
        Ok(sessions)
    }

    fn is_complete(&self, session: &str) -> Result<bool> {
        Ok(self.objects.head(&own("index", session))?.is_some())
    }

    pub(super) fn find(&self, session: &str) -> Result<Option<Found>> {
        let Some((partition, _)) = self.objects.get(&own("index", session))? else { return Ok(None) };
        let partition = String::from_utf8_lossy(&partition).trim().to_owned();
        let is_alone =
            self.objects.head(&format!("{SESSIONS}/{partition}/{}", file_name(session, 1)))?.is_some();
        Ok(Some(if is_alone { Found::Alone(partition) } else { Found::Compacted }))
    }

    /// Waits for other programs. `places` are those of files that may be left if this program stops. The lease `outer` is
    /// kept with the new one.
    pub(super) fn lease<'a>(
        &'a self,
        name: &str,
        places: &[String],
        outer: Option<&'a Lease<'a>>,
    ) -> Result<Lease<'a>> {
        let (key, owner) =
            (own("lease", name), format!("{:016x}", RandomState::new().build_hasher().finish()));
        let places: BTreeSet<String> = places.iter().cloned().collect();
        let mut seen: Option<(Tag, Instant)> = None;
        loop {
            outer.map_or(Ok(()), Lease::keep)?;
            let since = Moment::now();
            let old = self.objects.get(&key)?;
            let is_over = |(of, since): &(Tag, Instant)| {
                old.as_ref().is_some_and(|(_, tag)| tag == of) && since.elapsed() > self.patience
            };
            let is_free = old.as_ref().is_none_or(|(old, _)| old.starts_with(FREE.as_bytes()));
            if is_free || seen.as_ref().is_some_and(is_over) {
                let text = old
                    .as_ref()
                    .map_or_else(String::new, |(old, _)| String::from_utf8_lossy(old).into_owned());
                let left: BTreeSet<String> =
                    text.lines().skip(1).map(str::to_owned).filter(|place| !places.contains(place)).collect();
                let all: BTreeSet<String> = places.union(&left).cloned().collect();
                let text = format!("{owner} 0\n{}", lines(&all));
                if let Some(tag) = self.write(&key, &text, old.as_ref().map(|(_, tag)| tag))? {
                    let held = Mutex::new(Some(Held { tag, renewals: 0, since, places: all }));
                    return Ok(Lease { bucket: self, outer, key, owner, left, held });
                }
                continue;
            }
            let Some((_, tag)) = old else { continue };
            if seen.as_ref().is_none_or(|(of, _)| *of != tag) {
                if seen.is_none() {
                    note!(
                        "{}: another program works on {name}; this one waits, {} s if the other one was stopped",
                        self.address,
                        self.patience.as_secs()
                    );
                }
                seen = Some((tag, Instant::now()));
            }
            thread::sleep(self.patience / LOOKS);
        }
    }

    /// Writes a lease in place of `old`; `None` if another program did. If the answer to an earlier try was lost, its own
    /// text is there.
    fn write(&self, key: &str, text: &str, old: Option<&Tag>) -> Result<Option<Tag>> {
        let put = self.objects.put(key, text.into(), old.map_or(When::IsNew, When::Is));
        if matches!(put, Ok(Some(_))) {
            return put;
        }
        match self.objects.get(key) {
            Ok(Some((now, tag))) if now == text.as_bytes() => Ok(Some(tag)),
            _ => put,
        }
    }

    /// Adds a session's files, in place of those of `found`.
    pub(super) fn add(
        &self,
        lease: Lease<'_>,
        session: &str,
        partition: &str,
        files: &[(String, PathBuf)],
        replaced: Option<&str>,
    ) -> Result<()> {
        let mut gone: Vec<String> = lease.left.iter().filter(|place| is_inside(place)).cloned().collect();
        if let Some(old) = replaced {
            // A compaction that took it is over, and later ones leave a session with a lease.
            self.partition(old, Some(&lease))?.end()?;
            if !matches!(self.find(session)?, Some(Found::Alone(_))) {
                lease.end()?;
                bail!("{}: session {session} was compacted meanwhile, and stays as it is", self.address);
            }
            gone.extend(self.files(session, old)?);
            lease.add(&gone)?;
            lease.delete(&[own("index", session)])?;
        }
        let is_summary = |place: &String| place.starts_with(&format!("{SESSIONS}/"));
        let is_new = |place: &String| files.iter().any(|(new, _)| new == place);
        let (first, then): (Vec<_>, Vec<_>) = gone.into_iter().partition(is_summary);
        lease.delete(&first)?;
        lease.delete(&then.into_iter().filter(|place| !is_new(place)).collect::<Vec<_>>())?;
        let (last, first): (Vec<_>, Vec<_>) = files.iter().partition(|(place, _)| is_summary(place));
        for files in [first, last] {
            each(files, |(place, path)| self.objects.put_file(place, path, &|| lease.keep()))?;
        }
        lease.keep()?;
        self.objects.put(&own("index", session), format!("{partition}\n").into(), When::Always)?;
        lease.end()
    }

    fn tables(&self) -> Result<Vec<String>> {
        let tables = self.objects.folders("")?.into_iter();
        Ok(tables.filter(|table| !table.starts_with('.')).collect())
    }

    fn files(&self, session: &str, partition: &str) -> Result<Vec<String>> {
        let mut files = Vec::new();
        for table in self.tables()? {
            let all =
                self.objects.list(&format!("{table}/{partition}"))?.into_iter().map(|object| object.key);
            files.extend(all.filter(|key| key.rsplit('/').next().and_then(session_of) == Some(session)));
        }
        Ok(files)
    }

    pub(super) fn compact(&self, failed: &mut dyn FnMut(&str, &anyhow::Error)) -> Result<(Sum, usize)> {
        if self.objects.get(&format!("{OWN}/{STORAGE}"))?.is_none() {
            return Err(compact::no_tables(&self.address.to_string()));
        }
        self.recover()?;
        // Of a compaction that did not count, or was complete.
        self.objects.folders(&format!("{OWN}/new"))?.iter().try_for_each(|name| self.finish(name))?;
        // Of a program that was stopped after its session was complete.
        for session in self.leased(true)? {
            let lease = self.lease(&session, &[], None)?;
            if self.is_complete(&session)? {
                lease.end()?;
            }
        }
        let (mut sum, mut partitions) = (Sum::default(), 0);
        for date in self.objects.folders(SESSIONS)? {
            for bucket in self.objects.folders(&format!("{SESSIONS}/{date}"))? {
                let partition = format!("{date}/{bucket}");
                partitions += 1;
                match self.compact_one(&partition) {
                    Ok(part) => sum.add(part),
                    Err(error) => failed(&partition, &error),
                }
            }
        }
        let left = self.leased(false)?;
        if !left.is_empty() {
            note!(
                "{}: {} not complete, by programs that run or were stopped; decode again the logs of {}",
                self.address,
                count(left.len() as u64, "session"),
                left.join(", ")
            );
        }
        Ok((sum, partitions))
    }

    fn complete(&self, partition: &str) -> Result<BTreeSet<String>> {
        let rows = self.objects.list(&format!("{SESSIONS}/{partition}"))?;
        // Later than that list: a session without a lease was complete in it.
        let leases = self.objects.list(&format!("{OWN}/lease"))?;
        let leased: BTreeSet<&str> =
            leases.iter().filter_map(|object| object.key.rsplit('/').next()).collect();
        let names = rows.iter().filter_map(|object| session_of(object.key.rsplit('/').next()?));
        Ok(names.filter(|session| !leased.contains(session)).map(str::to_owned).collect())
    }

    fn compact_one(&self, partition: &str) -> Result<Sum> {
        if self.complete(partition)?.is_empty() {
            return Ok(Sum::default());
        }
        let lease = self.partition(partition, None)?;
        let new = own("new", partition);
        let sessions = self.complete(partition)?;
        if sessions.is_empty() {
            lease.end()?;
            return Ok(Sum::default());
        }
        let dir = storage::scratch()?;
        let (tables, objects) = (self.tables()?, self.to_compact(partition, &sessions)?);
        each(&objects, |object| {
            let file = dir.path().join(&object.key);
            file.parent().map_or(Ok(()), fs::create_dir_all)?;
            self.objects.fetch(object, &file, &|| lease.keep())
        })?;
        let merged = thread::scope(|scope| {
            let (working, ended) = mpsc::channel::<()>();
            let (root, tables) = (dir.path(), &tables);
            let work = scope.spawn(move || {
                let _working = working;
                compact::merged(root, tables, partition)
            });
            while ended.recv_timeout(self.patience / LOOKS) == Err(RecvTimeoutError::Timeout) {
                lease.keep()?;
            }
            work.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        })?;
        let Some(merged) = merged else { bail!("{partition}: its objects were changed by others") };
        let places = merged.transaction.places()?;
        each(&places, |place| {
            let path = merged.transaction.path(place);
            self.objects.put_file(&format!("{new}/{place}"), &path, &|| lease.keep())
        })?;
        let gone =
            merged.replaced.iter().filter(|place| !places.contains(place)).map(|place| format!("-{place}"));
        let change: Vec<String> = gone.chain(places.iter().map(|place| format!("+{place}"))).collect();
        lease.keep()?;
        self.objects.put(&own("commit", partition), lines(&change).into(), When::Always)?;
        self.apply(&lease, partition)?;
        lease.end()?;
        Ok(merged.sum)
    }

    fn to_compact(&self, partition: &str, sessions: &BTreeSet<String>) -> Result<Vec<Object>> {
        let mut all = Vec::new();
        for table in self.tables()? {
            let objects = self.objects.list(&format!("{table}/{partition}"))?;
            let name = |object: &Object| object.key.rsplit('/').next().unwrap_or_default().to_owned();
            let is_new =
                |object: &Object| session_of(&name(object)).is_some_and(|session| sessions.contains(session));
            if objects.iter().any(is_new) {
                let is_wanted =
                    |object: &Object| is_new(object) || compact::is_compacted(&name(object), object.bytes);
                all.extend(objects.into_iter().filter(is_wanted));
            }
        }
        Ok(all)
    }

    /// Carries out a change that counts. Each step may have been done before.
    fn apply(&self, lease: &Lease<'_>, name: &str) -> Result<()> {
        let commit = own("commit", name);
        let change = self
            .objects
            .get(&commit)?
            .map_or_else(String::new, |(change, _)| String::from_utf8_lossy(&change).into_owned());
        if let Some(place) = change.lines().filter_map(|line| line.get(1..)).find(|place| !is_inside(place)) {
            bail!(
                "{}: {commit} wants to change {place}, which is outside of the tables; if it is not your own, delete this object",
                self.address
            );
        }
        let of = |sign| change.lines().filter_map(move |line| line.strip_prefix(sign)).map(str::to_owned);
        lease.delete(&of('-').collect::<Vec<_>>())?;
        let new = own("new", name);
        let objects = self.objects.list(&new)?;
        each(of('+'), |place| {
            let object = objects.iter().find(|object| object.key == format!("{new}/{place}"));
            let object = object.with_context(|| {
                format!("{}: {commit}: {place} is missing in {new}; restore it", self.address)
            })?;
            lease.keep()?;
            if object.bytes <= COPIED_BYTES_MAX {
                return self.objects.copy(&object.key, &place);
            }
            let dir = storage::scratch()?;
            let file = dir.path().join("object");
            self.objects.fetch(object, &file, &|| lease.keep())?;
            self.objects.put_file(&place, &file, &|| lease.keep())
        })?;
        lease.delete(std::slice::from_ref(&commit))?;
        lease.delete(&objects.iter().map(|object| object.key.clone()).collect::<Vec<_>>())
    }
}

/// The first word of a lease without a holder.
const FREE: &str = "free";

#[derive(Clone, Copy)]
struct Moment(Instant, SystemTime);

impl Moment {
    fn now() -> Self {
        Self(Instant::now(), SystemTime::now())
    }

    /// Time since then, by the faster clock: one of both stands while a computer sleeps.
    fn elapsed(self) -> Duration {
        self.0.elapsed().max(self.1.elapsed().unwrap_or_default())
    }
}

struct Held {
    tag: Tag,
    renewals: u64,
    since: Moment,
    places: BTreeSet<String>,
}

/// The right to change a session, or a date and bucket. Dropped, it is free, with its list.
pub(super) struct Lease<'a> {
    bucket: &'a Bucket,
    /// Is renewed with this one.
    outer: Option<&'a Self>,
    key: String,
    owner: String,
    /// Files of a program that stopped, besides its own ones.
    left: BTreeSet<String>,
    /// `None` after its end, or if another program has it.
    held: Mutex<Option<Held>>,
}

impl Lease<'_> {
    /// Before each request: renews the lease if it is old, again if that took long.
    fn keep(&self) -> Result<()> {
        self.outer.map_or(Ok(()), Self::keep)?;
        let is_due = |held: &Held| held.since.elapsed() > self.bucket.patience / RENEWALS;
        while self.renew(&[], is_due)? {}
        Ok(())
    }

    fn add(&self, places: &[String]) -> Result<()> {
        self.renew(places, |_| true).map(|_| ())
    }

    /// Whether it was due.
    fn renew(&self, places: &[String], is_due: impl FnOnce(&Held) -> bool) -> Result<bool> {
        let mut held = self.held.lock().unwrap_or_else(PoisonError::into_inner);
        let lost =
            || format!("{}: another program has taken over {}; run again", self.bucket.address, self.key);
        let now = held.as_mut().with_context(lost)?;
        if !is_due(now) {
            return Ok(false);
        }
        now.places.extend(places.iter().cloned());
        now.renewals += 1;
        let since = Moment::now();
        let text = format!("{} {}\n{}", self.owner, now.renewals, lines(&now.places));
        let Some(tag) = self.bucket.write(&self.key, &text, Some(&now.tag))? else {
            *held = None;
            bail!(lost());
        };
        (now.tag, now.since) = (tag, since);
        Ok(true)
    }

    fn delete(&self, keys: &[String]) -> Result<()> {
        for keys in keys.chunks(DELETED_MAX) {
            self.keep()?;
            self.bucket.objects.delete(keys)?;
        }
        Ok(())
    }

    /// The work is complete.
    pub(super) fn end(self) -> Result<()> {
        self.delete(std::slice::from_ref(&self.key))?;
        *self.held.lock().unwrap_or_else(PoisonError::into_inner) = None;
        Ok(())
    }
}

impl Drop for Lease<'_> {
    fn drop(&mut self) {
        let Some(held) = self.held.get_mut().unwrap_or_else(PoisonError::into_inner) else { return };
        // If it fails, the next program waits.
        if held.places.is_empty() {
            let _ = self.delete(std::slice::from_ref(&self.key));
        } else {
            let text = format!("{FREE}\n{}", lines(&held.places));
            let _ = self.bucket.objects.put(&self.key, text.into(), When::Is(&held.tag));
        }
    }
}
