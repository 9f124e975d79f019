//! Object storage with the protocol of S3, as `s3://BUCKET/PREFIX` on the command line.
//!
//! The feature `object-storage` has the client. The rest is built without it too, for one error text and for the tests.

#[cfg(feature = "object-storage")]
mod http;
#[cfg(feature = "object-storage")]
mod s3;
#[cfg(test)]
pub(crate) mod tests;

use std::fmt;
use std::fs;
use std::path::{Component, Path, PathBuf};

use anyhow::{Context as _, Result, bail};
use tempfile::TempDir;

use crate::logs::in_order::in_order;
use crate::outcome::{exists, usage};
use crate::output;

const SCHEME: &str = "s3://";
/// The folder of all buckets.
const ROOT: &str = "s3:/";
const AT_ONCE: usize = 4;
/// Objects of an input at most: each takes some hundred bytes.
const INPUTS_MAX: usize = 10_000;

/// A place in object storage.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Address {
    /// The name of the bucket.
    pub bucket: String,
    /// The names of its objects begin with it; without slashes at its ends.
    pub prefix: String,
}

impl Address {
    /// The address that a path of a command line stands for; `None` for a file.
    ///
    /// # Errors
    /// A usage error if no bucket is named, or a part of the prefix is empty or consists of dots.
    pub fn of(path: &Path) -> Result<Option<Self>> {
        let Some(rest) = path.to_str().and_then(|text| text.strip_prefix(SCHEME)) else { return Ok(None) };
        let (bucket, prefix) = rest.split_once('/').unwrap_or((rest, ""));
        let prefix = prefix.trim_end_matches('/');
        if !is_name(bucket) || !prefix.is_empty() && !prefix.split('/').all(is_name) {
            return Err(usage(format!("{}: is not s3://BUCKET/PREFIX", path.display())));
        }
        Ok(Some(Self { bucket: bucket.to_owned(), prefix: prefix.to_owned() }))
    }

    /// The path that is shown for a place below it.
    pub fn shown(&self, place: &str) -> PathBuf {
        PathBuf::from(format!("{self}/{place}"))
    }

    fn parent(&self) -> Self {
        let prefix = self.prefix.rsplit_once('/').map_or("", |(parent, _)| parent);
        Self { prefix: prefix.to_owned(), ..self.clone() }
    }

    fn name(&self) -> &str {
        if self.prefix.is_empty() { &self.bucket } else { self.prefix.rsplit('/').next().unwrap_or_default() }
    }
}

impl fmt::Display for Address {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let slash = if self.prefix.is_empty() { "" } else { "/" };
        write!(f, "{SCHEME}{}{slash}{}", self.bucket, self.prefix)
    }
}

/// The content of an object at one moment: its `ETag`.
pub(crate) type Tag = String;

#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Object {
    pub(crate) key: String,
    pub(crate) bytes: u64,
    pub(crate) tag: Tag,
}

/// The condition of a write, checked by the server.
#[derive(Clone, Copy, Debug)]
pub(crate) enum When<'a> {
    Always,
    /// No object has the key.
    IsNew,
    /// The object has this content.
    #[cfg_attr(not(any(test, feature = "object-storage")), expect(dead_code, reason = "the client reads it"))]
    Is(&'a Tag),
}

/// Objects below an address; keys are relative to it. A request ends within [`REQUEST_S`], with its repetitions.
pub(crate) trait Objects: Send + Sync {
    /// Writes an object as a whole; `None` if the condition is not met.
    fn put(&self, key: &str, bytes: Vec<u8>, when: When<'_>) -> Result<Option<Tag>>;
    /// Writes a file of any size. It calls `proceed` before each request.
    fn put_file(&self, key: &str, path: &Path, proceed: &dyn Fn() -> Result<()>) -> Result<()>;
    fn get(&self, key: &str) -> Result<Option<(Vec<u8>, Tag)>>;
    fn head(&self, key: &str) -> Result<Option<Object>>;
    /// Writes an object of any size to a file. It calls `proceed` before each request.
    fn fetch(&self, object: &Object, to: &Path, proceed: &dyn Fn() -> Result<()>) -> Result<()>;
    /// All objects below a folder, also in folders of it.
    fn list(&self, folder: &str) -> Result<Vec<Object>>;
    /// Names of the folders in a folder.
    fn folders(&self, folder: &str) -> Result<Vec<String>>;
    /// At most [`DELETED_MAX`] objects; missing ones are no error.
    fn delete(&self, keys: &[String]) -> Result<()>;
    /// An object of at most [`COPIED_BYTES_MAX`].
    fn copy(&self, from: &str, to: &str) -> Result<()>;
}

/// Does `work` for all items, some at once. The first error ends it.
pub(crate) fn each<T: Send>(
    items: impl IntoIterator<Item = T>,
    work: impl Fn(T) -> Result<()> + Sync,
) -> Result<()> {
    let mut items = items.into_iter();
    in_order(AT_ONCE, AT_ONCE, || Ok(items.next()), work, |done| done)
}

/// A request with all of its repetitions takes at most so long.
pub(crate) const REQUEST_S: u64 = 140;
/// A server copies a larger object too slowly for one request. In tests two sessions in a file are smaller, and three larger.
pub(crate) const COPIED_BYTES_MAX: u64 = if cfg!(test) { 620 } else { 128 << 20 };
/// The protocol's limit for one request.
pub(crate) const DELETED_MAX: usize = 1_000;

#[cfg(feature = "object-storage")]
pub(crate) fn open(address: &Address) -> Result<Box<dyn Objects>> {
    Ok(Box::new(s3::S3::open(address)?))
}

#[cfg(not(feature = "object-storage"))]
pub(crate) fn open(address: &Address) -> Result<Box<dyn Objects>> {
    bail!(
        "{address}: this hums was built without object storage; build it with `cargo install --locked --path host-tools --features object-storage`"
    )
}

/// Inputs on this computer, in place of those in object storage.
#[derive(Debug, Default)]
pub struct LocalInputs(Option<TempDir>);

impl LocalInputs {
    /// Fetches each input that is in object storage: an object, or all objects below a prefix. Messages show the address.
    ///
    /// # Errors
    /// Nothing is there, the server cannot be reached, or the disk is full.
    pub fn inputs<'a>(inputs: impl IntoIterator<Item = &'a mut PathBuf>) -> Result<Self> {
        let mut fetched = Self::default();
        for input in inputs {
            if let Some(address) = Address::of(input)? {
                *input = fetched.fetch(&address)?;
            }
        }
        Ok(fetched)
    }

    fn fetch(&mut self, address: &Address) -> Result<PathBuf> {
        let dir = match self.0.take() {
            Some(dir) => dir,
            None => scratch()?,
        };
        let dir = self.0.insert(dir).path();
        output::alias(dir, ROOT);
        let to = dir.join(&address.bucket).join(&address.prefix);
        let from = open(&address.parent())?;
        if let Some(object) = from.head(address.name())?.filter(|_| !address.prefix.is_empty()) {
            to.parent().map_or(Ok(()), fs::create_dir_all)?;
            from.fetch(&object, &to, &|| Ok(()))?;
            return Ok(to);
        }
        let from = open(address)?;
        let mut objects = from.list("")?;
        let is_of_fleet = objects.iter().any(|object| object.key.starts_with("sessions/date="));
        // The page of a fleet needs one table.
        objects.retain(|object| !is_of_fleet || object.key.starts_with("sessions/"));
        objects.retain(|object| is_inside(&object.key));
        match objects.len() {
            0 => bail!("{address}: no object has this name or begins with it"),
            objects if objects > INPUTS_MAX && !is_of_fleet => {
                bail!("{address}: {objects} objects are more than {INPUTS_MAX}; name a longer prefix")
            }
            _ => {}
        }
        fs::create_dir_all(&to)?;
        each(&objects, |object| {
            let file = to.join(&object.key);
            file.parent().map_or(Ok(()), fs::create_dir_all)?;
            from.fetch(object, &file, &|| Ok(()))
        })?;
        Ok(to)
    }
}

/// A file or folder on this computer whose content goes to object storage.
#[derive(Debug)]
pub(crate) struct Upload {
    address: Address,
    dir: TempDir,
    path: PathBuf,
}

impl Upload {
    /// `output` is as on the command line: with a slash at its end it is a folder.
    pub(crate) fn new(address: &Address, output: &Path, force: bool) -> Result<Self> {
        Self::check_free(address, force)?;
        let dir = scratch()?;
        let slash = if output.to_string_lossy().ends_with('/') { "/" } else { "" };
        let path = dir.path().join(format!("{}{slash}", address.name()));
        let parent = if address.prefix.is_empty() { ROOT.to_owned() } else { address.parent().to_string() };
        output::alias(dir.path(), &parent);
        Ok(Self { address: address.clone(), dir, path })
    }

    /// An object of this name is an error before the work, not after it.
    fn check_free(address: &Address, force: bool) -> Result<()> {
        let is_there = || anyhow::Ok(open(&address.parent())?.head(address.name())?.is_some());
        if !force && !address.prefix.is_empty() && is_there()? {
            return Err(exists(Path::new(&address.to_string()), true));
        }
        Ok(())
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Sends all files, except those in hidden folders. An object that exists is not overwritten without `--force`.
    pub(crate) fn send(&self, force: bool) -> Result<()> {
        let is_file = self.path.is_file();
        let (objects, folder) = if is_file {
            (open(&self.address.parent())?, self.dir.path())
        } else {
            (open(&self.address)?, self.path.as_path())
        };
        let mut places = Vec::new();
        files(folder, "", &mut places)?;
        each(&places, |place| {
            if !force && objects.head(place)?.is_some() {
                return Err(exists(&folder.join(place), true));
            }
            objects.put_file(place, &folder.join(place), &|| Ok(()))
        })
    }
}

pub(crate) fn scratch() -> Result<TempDir> {
    tempfile::tempdir().context("a temporary folder cannot be made; TMPDIR names another folder for it")
}

fn files(folder: &Path, prefix: &str, places: &mut Vec<String>) -> Result<()> {
    for name in crate::fleet::names(&folder.join(prefix))?.into_iter().filter(|name| !name.starts_with('.')) {
        let place = if prefix.is_empty() { name } else { format!("{prefix}/{name}") };
        if folder.join(&place).is_dir() {
            files(folder, &place, places)?;
        } else {
            places.push(place);
        }
    }
    Ok(())
}

/// A server's list without folders as objects (`logs/`), and keys that are no paths (`logs//a`): the client would refuse it.
#[cfg(any(test, feature = "object-storage"))]
fn listed(body: Vec<u8>) -> Vec<u8> {
    let Some(text) = str::from_utf8(&body).ok().filter(|text| text.contains("<ListBucketResult")) else {
        return body;
    };
    let is_path = |item: &str| {
        let key = item.split_once("<Key>").or_else(|| item.split_once("<Prefix>"));
        let key = key.and_then(|(_, key)| key.split_once('<')).map_or("", |(key, _)| key);
        let path = if item.contains("<Key>") { key } else { key.strip_suffix('/').unwrap_or(key) };
        let is_path = path.split('/').all(is_name);
        if !is_path && !key.ends_with('/') {
            note!("{key}: is no path, so this object is left out; rename it");
        }
        is_path
    };
    let mut left = text.to_owned();
    for end in ["</Contents>", "</CommonPrefixes>"] {
        let begin = end.replace('/', "");
        let items = left.split_inclusive(end).map(|part| {
            let (before, item) = part.split_once(&begin).unwrap_or((part, ""));
            if item.is_empty() || is_path(item) { part } else { before }
        });
        left = items.collect();
    }
    left.into_bytes()
}

fn is_name(part: &str) -> bool {
    !["", ".", ".."].contains(&part)
}

pub(crate) fn is_inside(key: &str) -> bool {
    let mut parts = Path::new(key).components();
    !key.is_empty() && !key.ends_with('/') && parts.all(|part| matches!(part, Component::Normal(_)))
}
