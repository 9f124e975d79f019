//! Objects in memory: a server whose client is stopped at a chosen request, whose answer is lost.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex};

use super::*;

/// A server.
#[derive(Debug, Default)]
pub(crate) struct Memory {
    pub(crate) objects: Mutex<BTreeMap<String, Vec<u8>>>,
    /// Requests until the failure of all further ones.
    pub(crate) left: Mutex<Option<u32>>,
    pub(crate) kind: Kind,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Kind {
    #[default]
    Sound,
    /// The answer to a conditional write is lost, and the client repeats it.
    Repeated,
    /// Without `If-None-Match`.
    NoneMatches,
    /// Without `If-Match`.
    AllMatch,
}

impl Memory {
    /// An error if the client was stopped. The last request is done, and its answer is lost.
    fn request<T>(&self, work: impl FnOnce(&mut BTreeMap<String, Vec<u8>>) -> T) -> Result<T> {
        let mut left = self.left.lock().expect("no panic");
        if *left == Some(0) {
            bail!("stopped");
        }
        let done = work(&mut self.objects.lock().expect("no panic"));
        if let Some(left) = &mut *left {
            *left -= 1;
            if *left == 0 {
                bail!("stopped");
            }
        }
        Ok(done)
    }
}

fn tag(bytes: &[u8]) -> Tag {
    crate::hex::hex(&sha2::Digest::finalize(<sha2::Sha256 as sha2::Digest>::new_with_prefix(bytes))[..16])
}

fn object(key: &str, bytes: &[u8]) -> Object {
    Object { key: key.to_owned(), bytes: bytes.len() as u64, tag: tag(bytes) }
}

impl Objects for Arc<Memory> {
    fn put(&self, key: &str, bytes: Vec<u8>, when: When<'_>) -> Result<Option<Tag>> {
        self.request(|objects| {
            let is_met = match (when, objects.get(key)) {
                (When::Always, _) | (When::IsNew, None) => true,
                (When::Is(wanted), Some(old)) => tag(old) == *wanted || self.kind == Kind::AllMatch,
                (When::IsNew, Some(_)) => self.kind == Kind::NoneMatches,
                (When::Is(_), None) => self.kind == Kind::AllMatch,
            };
            let new = tag(&bytes);
            if is_met {
                objects.insert(key.to_owned(), bytes);
            }
            let is_repeated = self.kind == Kind::Repeated && !matches!(when, When::Always);
            (is_met && !is_repeated).then_some(new)
        })
    }

    fn put_file(&self, key: &str, path: &Path, proceed: &dyn Fn() -> Result<()>) -> Result<()> {
        proceed()?;
        self.put(key, fs::read(path)?, When::Always).map(|_| ())
    }

    fn get(&self, key: &str) -> Result<Option<(Vec<u8>, Tag)>> {
        self.request(|objects| objects.get(key).map(|bytes| (bytes.clone(), tag(bytes))))
    }

    fn head(&self, key: &str) -> Result<Option<Object>> {
        self.request(|objects| objects.get(key).map(|bytes| object(key, bytes)))
    }

    fn fetch(&self, object: &Object, to: &Path, proceed: &dyn Fn() -> Result<()>) -> Result<()> {
        proceed()?;
        let Some((bytes, _)) = self.get(&object.key)? else { bail!("{}: is missing", object.key) };
        Ok(fs::write(to, bytes)?)
    }

    fn list(&self, folder: &str) -> Result<Vec<Object>> {
        let folder = if folder.is_empty() { String::new() } else { format!("{folder}/") };
        let is_in = |(key, _): &(&String, &Vec<u8>)| key.starts_with(&folder);
        self.request(|objects| objects.iter().filter(is_in).map(|(key, bytes)| object(key, bytes)).collect())
    }

    fn folders(&self, folder: &str) -> Result<Vec<String>> {
        let skip = if folder.is_empty() { 0 } else { folder.len() + 1 };
        let objects = self.list(folder)?;
        let names = objects.iter().filter_map(|object| object.key.get(skip..)?.split_once('/'));
        Ok(names.map(|(name, _)| name.to_owned()).collect::<BTreeSet<_>>().into_iter().collect())
    }

    fn delete(&self, keys: &[String]) -> Result<()> {
        self.request(|objects| keys.iter().for_each(|key| drop(objects.remove(key))))
    }

    fn copy(&self, from: &str, to: &str) -> Result<()> {
        let is_there = self.request(|objects| {
            let bytes = objects.get(from).cloned().filter(|bytes| bytes.len() as u64 <= COPIED_BYTES_MAX);
            bytes.map(|bytes| objects.insert(to.to_owned(), bytes)).is_some()
        })?;
        if is_there { Ok(()) } else { bail!("{from}: is missing") }
    }
}

#[test]
fn an_address_has_a_bucket_and_a_prefix_without_dots() {
    let of = |text: &str| Address::of(Path::new(text));
    let address = of("s3://fleet/all/2026/").expect("good").expect("an address");
    assert_eq!((address.bucket.as_str(), address.prefix.as_str()), ("fleet", "all/2026"));
    assert_eq!(address.shown("A/b.parquet"), Path::new("s3://fleet/all/2026/A/b.parquet"));
    assert_eq!((address.name(), address.parent().to_string().as_str()), ("2026", "s3://fleet/all"));
    let bucket = of("s3://fleet").expect("good").expect("an address");
    assert_eq!((bucket.name(), bucket.to_string().as_str()), ("fleet", "s3://fleet"));
    for bad in ["s3://", "s3:///all", "s3://..", "s3://fleet//all", "s3://fleet/../all", "s3://fleet/./all"] {
        of(bad).expect_err(bad);
    }
    for file in ["flight.tlog", "s3:/fleet", "./s3://fleet", ""] {
        assert_eq!(of(file).expect("a file"), None, "{file}");
    }
}

#[test]
fn a_key_of_others_is_no_path_out_of_a_folder() {
    for key in ["a", "a/b.bin", "a.b/c"] {
        assert!(is_inside(key), "{key}");
    }
    for key in ["", "/etc/passwd", "../a", "a/../../b", "folder/"] {
        assert!(!is_inside(key), "{key}");
    }
}

#[test]
fn a_list_leaves_out_folders_and_keys_that_are_no_paths() {
    let begin = "<?xml version=\"1.0\"?><ListBucketResult><Prefix>all/</Prefix>";
    let object = |key: &str| format!("<Contents><Size>0</Size><Key>{key}</Key></Contents>");
    let folder = |key: &str| format!("<CommonPrefixes><Prefix>{key}</Prefix></CommonPrefixes>");
    let list = |keys: &[&str], folders: &[&str]| {
        let keys = keys.iter().map(|key| object(key)).chain(folders.iter().map(|key| folder(key)));
        format!("{begin}{}<KeyCount>1</KeyCount></ListBucketResult>", keys.collect::<String>())
    };
    let all =
        list(&["logs/", "logs/a", "logs//b", "/c", "./d", "logs/.d", "logs/.."], &["all/A/", "all//", "//"]);
    assert_eq!(String::from_utf8(listed(all.into())), Ok(list(&["logs/a", "logs/.d"], &["all/A/"])));
    for other in [&b"\xff<ListBucketResult"[..], b"<Contents><Key>a//b</Key></Contents>"] {
        assert_eq!(listed(other.to_vec()), other);
    }
}

#[cfg(not(feature = "object-storage"))]
#[test]
fn a_program_without_object_storage_says_how_to_get_it() {
    let mut input = PathBuf::from("s3://fleet/flight.tlog");
    let error = LocalInputs::inputs([&mut input]).expect_err("no client").to_string();
    assert!(error.contains("--features object-storage"), "{error}");
}
