//! The client of S3: `object_store`, one request at a time in each thread.

use std::error::Error as _;
use std::fs::File;
use std::io::{Read as _, Write as _};
use std::iter;
use std::path::Path;
use std::sync::{Mutex, MutexGuard, TryLockError};
use std::thread;
use std::time::Duration;

use anyhow::{Context as _, Result, anyhow, bail};
use futures_util::{StreamExt as _, TryStreamExt as _, stream};
use object_store::aws::{AmazonS3, AmazonS3Builder};
use object_store::client::{HttpError, HttpErrorKind};
use object_store::path::Path as Key;
use object_store::{
    BackoffConfig, Error, GetOptions, GetRange, ObjectMeta, ObjectStore, ObjectStoreExt as _, PutMode,
    PutOptions, PutPayload, RetryConfig, UpdateVersion,
};

use super::http::{Connector, LIMIT};
use super::{Address, Object, Objects, REQUEST_S, Tag, When};
use crate::files::cannot_write;

/// Bytes of a part: the protocol's least, so that a slow line sends it in time.
const PART_BYTES: u64 = 5 << 20;
/// Larger parts go one after the other: a line of 2 Mbit/s is enough.
const SMALL_BYTES: u64 = 256 << 10;
/// A part waits so long before it looks again.
const TURN: Duration = Duration::from_millis(20);
/// No repetition of a failed request begins later: one after a timeout.
const RETRIES_END: Duration = Duration::from_secs(40);
const _: () = assert!(RETRIES_END.as_secs() > LIMIT.as_secs());
const RETRIES_MAX: usize = 4;
/// Credentials may be fetched before a request, with repetitions of their own.
const _: () = assert!(2 * (LIMIT.as_secs() + RETRIES_END.as_secs()) <= REQUEST_S);

pub(super) struct S3 {
    store: AmazonS3,
    address: Address,
    /// Held while a large part goes over it.
    line: Mutex<()>,
}

impl S3 {
    /// With the variables of the environment that AWS's own tools read.
    pub(super) fn open(address: &Address) -> Result<Self> {
        let backoff = BackoffConfig {
            init_backoff: Duration::from_millis(200),
            max_backoff: Duration::from_secs(3),
            base: 2.0,
        };
        let retries = RetryConfig { backoff, max_retries: RETRIES_MAX, retry_timeout: RETRIES_END };
        let store = AmazonS3Builder::from_env()
            .with_bucket_name(&address.bucket)
            .with_http_connector(Connector)
            .with_retry(retries)
            .build()
            .with_context(|| address.to_string())?;
        Ok(Self { store, address: address.clone(), line: Mutex::default() })
    }

    fn key(&self, key: &str) -> Result<Key> {
        let slash = if self.address.prefix.is_empty() || key.is_empty() { "" } else { "/" };
        Key::parse(format!("{}{slash}{key}", self.address.prefix)).with_context(|| self.address.to_string())
    }

    fn object(&self, about: ObjectMeta) -> Object {
        let key = about.location.as_ref();
        let key = key.strip_prefix(self.address.prefix.as_str()).unwrap_or(key).trim_start_matches('/');
        Object { key: key.to_owned(), bytes: about.size, tag: about.e_tag.unwrap_or_default() }
    }

    /// The cause in the server's words, and what to do.
    fn failed(&self, error: &Error) -> anyhow::Error {
        let whole = error.to_string();
        let between = |begin: &str, end| Some(whole.split_once(begin)?.1.split_once(end)?.0);
        let causes = || iter::successors(error.source(), |&cause| cause.source());
        let is_late = |cause: &(dyn std::error::Error + 'static)| {
            cause.downcast_ref::<HttpError>().is_some_and(|error| error.kind() == HttpErrorKind::Timeout)
        };
        let words = match (between("<Code>", "</Code>"), between("<Message>", "</Message>")) {
            (Some(code), message) => format!("{code}: {}", message.unwrap_or_default()),
            _ => causes().last().map_or_else(|| whole.clone(), ToString::to_string),
        };
        let server = between("://", "/").unwrap_or("the server");
        let advice = match error {
            _ if whole.contains("NoSuchBucket") => "create the bucket, or correct its name".to_owned(),
            _ if whole.contains("/latest/meta-data") || whole.contains("/latest/api/token") => {
                "no credentials: set AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY".to_owned()
            }
            Error::PermissionDenied { .. } | Error::Unauthenticated { .. } => {
                "check AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY, and their rights".to_owned()
            }
            Error::NotFound { .. } | Error::Precondition { .. } | Error::AlreadyExists { .. } => {
                "an object was changed meanwhile: run again".to_owned()
            }
            _ if causes().any(is_late) => {
                format!("{server} took {} s: find a faster line (2 Mbit/s), and run again", LIMIT.as_secs())
            }
            _ => format!("{server} failed: check AWS_ENDPOINT_URL and AWS_REGION, and run again"),
        };
        anyhow!("{}: {}; {advice}", self.address, words.trim_end_matches('.'))
    }

    /// Before each part: a large one waits for others, and the lease is kept meanwhile.
    fn turn(&self, bytes: u64, proceed: &dyn Fn() -> Result<()>) -> Result<Option<MutexGuard<'_, ()>>> {
        loop {
            proceed()?;
            if bytes <= SMALL_BYTES {
                return Ok(None);
            }
            match self.line.try_lock() {
                Ok(turn) => return Ok(Some(turn)),
                Err(TryLockError::Poisoned(turn)) => return Ok(Some(turn.into_inner())),
                Err(TryLockError::WouldBlock) => thread::sleep(TURN),
            }
        }
    }

    fn settle<T>(&self, result: object_store::Result<T>) -> Result<T> {
        result.map_err(|error| self.failed(&error))
    }

    /// `None` if the object is missing. A missing bucket is an error.
    fn known<T>(&self, result: object_store::Result<T>) -> Result<Option<T>> {
        match result {
            Err(error @ Error::NotFound { .. }) if !error.to_string().contains("NoSuchBucket") => Ok(None),
            result => self.settle(result).map(Some),
        }
    }
}

/// A runtime for the clock of repetitions; the requests themselves block.
fn wait<T>(work: impl Future<Output = T>) -> Result<T> {
    Ok(tokio::runtime::Builder::new_current_thread().enable_time().build()?.block_on(work))
}

impl Objects for S3 {
    fn put(&self, key: &str, bytes: Vec<u8>, when: When<'_>) -> Result<Option<Tag>> {
        let mode = match when {
            When::Always => PutMode::Overwrite,
            When::IsNew => PutMode::Create,
            When::Is(tag) => PutMode::Update(UpdateVersion { e_tag: Some(tag.clone()), version: None }),
        };
        let options = PutOptions { mode, ..PutOptions::default() };
        match wait(self.store.put_opts(&self.key(key)?, PutPayload::from(bytes), options))? {
            Err(Error::AlreadyExists { .. } | Error::Precondition { .. })
                if !matches!(when, When::Always) =>
            {
                Ok(None)
            }
            put => Ok(Some(self.settle(put)?.e_tag.unwrap_or_default())),
        }
    }

    fn put_file(&self, key: &str, path: &Path, proceed: &dyn Fn() -> Result<()>) -> Result<()> {
        let to = self.key(key)?;
        let file = File::open(path)?;
        let mut left = file.metadata()?.len();
        let part = |left| {
            let turn = self.turn(left, proceed)?;
            let mut bytes = Vec::new();
            (&file).take(PART_BYTES).read_to_end(&mut bytes)?;
            anyhow::Ok((turn, PutPayload::from(bytes)))
        };
        if left <= PART_BYTES {
            let (_turn, part) = part(left)?;
            return self.settle(wait(self.store.put(&to, part))?).map(|_| ());
        }
        let mut upload = self.settle(wait(self.store.put_multipart(&to))?)?;
        let mut send = || {
            while left > 0 {
                let (_turn, part) = part(left)?;
                self.settle(wait(upload.put_part(part))?)?;
                left = left.saturating_sub(PART_BYTES);
            }
            proceed()
        };
        let sent = send();
        match sent {
            Ok(()) => self.settle(wait(upload.complete())?).map(|_| ()),
            Err(error) => {
                // Parts that stay are invisible, and the bucket's rules remove them.
                let _ = wait(upload.abort());
                Err(error)
            }
        }
    }

    fn get(&self, key: &str) -> Result<Option<(Vec<u8>, Tag)>> {
        let key = self.key(key)?;
        let got = wait(async {
            let got = self.store.get(&key).await?;
            let tag = got.meta.e_tag.clone().unwrap_or_default();
            Ok((got.bytes().await?.to_vec(), tag))
        })?;
        self.known(got)
    }

    fn head(&self, key: &str) -> Result<Option<Object>> {
        let about = wait(self.store.head(&self.key(key)?))?;
        Ok(self.known(about)?.map(|about| self.object(about)))
    }

    fn fetch(&self, object: &Object, to: &Path, proceed: &dyn Fn() -> Result<()>) -> Result<()> {
        let key = self.key(&object.key)?;
        let mut file = File::create_new(to).with_context(|| cannot_write(to))?;
        let mut from = 0;
        while from < object.bytes {
            let _turn = self.turn(object.bytes - from, proceed)?;
            let end = object.bytes.min(from + PART_BYTES);
            // All parts are of one version.
            let if_match = Some(object.tag.clone()).filter(|tag| !tag.is_empty());
            let options =
                GetOptions { range: Some(GetRange::Bounded(from..end)), if_match, ..GetOptions::default() };
            let bytes = wait(async { self.store.get_opts(&key, options).await?.bytes().await })?;
            let bytes = self.settle(bytes)?;
            if bytes.len() as u64 != end - from {
                bail!("{}: {} was changed while it was read; try again", self.address, object.key);
            }
            file.write_all(&bytes).with_context(|| cannot_write(to))?;
            from = end;
        }
        Ok(())
    }

    fn list(&self, folder: &str) -> Result<Vec<Object>> {
        let key = self.key(folder)?;
        let all: Vec<ObjectMeta> = self.settle(wait(self.store.list(Some(&key)).try_collect())?)?;
        Ok(all.into_iter().map(|about| self.object(about)).collect())
    }

    fn folders(&self, folder: &str) -> Result<Vec<String>> {
        let all = self.settle(wait(self.store.list_with_delimiter(Some(&self.key(folder)?)))?)?;
        Ok(all.common_prefixes.iter().filter_map(Key::filename).map(str::to_owned).collect())
    }

    fn delete(&self, keys: &[String]) -> Result<()> {
        let keys = keys.iter().map(|key| self.key(key).map(Ok)).collect::<Result<Vec<_>>>()?;
        let deleted: object_store::Result<Vec<Key>> =
            wait(self.store.delete_stream(stream::iter(keys).boxed()).try_collect())?;
        self.known(deleted).map(|_| ())
    }

    fn copy(&self, from: &str, to: &str) -> Result<()> {
        self.settle(wait(self.store.copy(&self.key(from)?, &self.key(to)?))?)
    }
}
