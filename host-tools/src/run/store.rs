//! `--store FILE`: flash that outlives power.

use std::cell::RefCell;
use std::fs::{File, OpenOptions};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::Path;
use std::rc::Rc;

use anyhow::{Context, Result, anyhow, bail};
use embedded_storage::nor_flash::{ErrorType, NorFlash, NorFlashErrorKind, ReadNorFlash};
use hums_core::parameters::ParamSpec;
use hums_store::sim::{SimFlash, is_store};
use hums_store::{Key, Store, StoreCondition, param_value};

use crate::files::{cannot_write, make_in_place, open_in_place};
use crate::source::format::STORE_SECTOR_BYTES as SECTOR;

/// Two of them are the store.
const BYTES: usize = 2 * SECTOR;

/// Makes a missing file, and sets parameters like a ground station. Without a path everything ends with the run.
pub(super) fn open(path: Option<&Path>, params: &[(&ParamSpec, f32)]) -> Result<FileFlash> {
    let (bytes, mut file) = match path {
        Some(path) => read(path)?,
        None => (Vec::new(), None),
    };
    // Overwritten with the items that still count.
    if let Some(path) = path.filter(|_| found(&bytes) == Some(StoreCondition::Damaged)) {
        drop(file);
        let whole = |mut file: &File| file.write_all(&bytes).with_context(|| cannot_write(path));
        file = Some(make_in_place(path, true, whole).context("--store")?);
    }
    let flash = FileFlash(Rc::new(RefCell::new(Inside { flash: SimFlash::with(&bytes), file, error: None })));
    flash.write_out(0, BYTES);
    if !params.is_empty() {
        let context = |error| anyhow!("--params: cannot be stored: {error:?}");
        let (mut store, _) = Store::mount(flash.clone()).map_err(context)?;
        store.allow_erase(true);
        for (spec, value) in params {
            let Some((bytes, length)) = param_value(spec.name, *value) else { continue };
            store.save(Key::param(spec.name), bytes.get(..length).unwrap_or_default()).map_err(context)?;
        }
    }
    match flash.take_error() {
        Some(error) => {
            let path = path.unwrap_or(Path::new(""));
            Err(error).with_context(|| format!("--store {}: cannot be written", path.display()))
        }
        None => Ok(flash),
    }
}

pub(super) fn check(path: &Path) -> Result<()> {
    if path.exists() {
        let (bytes, _) = read(path)?;
        if found(&bytes) == Some(StoreCondition::Damaged) {
            let path = path.display();
            note!(
                "--store {path}: is damaged: a stored item was lost, its older value counts or it begins anew"
            );
        }
        return Ok(());
    }
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    if let Some(folder) = folder.filter(|folder| !folder.is_dir()) {
        bail!("--store {}: cannot be made; there is no folder {}", path.display(), folder.display());
    }
    Ok(())
}

fn read(path: &Path) -> Result<(Vec<u8>, Option<File>)> {
    if let Ok(about) = path.metadata() {
        if !about.is_file() {
            bail!("--store {}: is no file; name one", path.display());
        }
        if about.permissions().readonly() {
            bail!("--store {}: is read-only; make it writable or name another file", path.display());
        }
    }
    let context = || format!("--store {}: cannot be opened for reading and writing", path.display());
    let mut file = match open_in_place(OpenOptions::new().read(true).write(true), path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            return Ok((
                Vec::new(),
                Some(make_in_place(path, false, |file| fill(file, path)).context("--store")?),
            ));
        }
        opened => opened.with_context(context)?,
    };
    let mut bytes = Vec::new();
    Read::by_ref(&mut file).take(BYTES as u64 + 1).read_to_end(&mut bytes).with_context(context)?;
    if !bytes.is_empty() && bytes.len() != BYTES {
        bail!("--store {}: is no store, which has {BYTES} bytes; name a new file", path.display());
    }
    if !bytes.is_empty() && !is_store::<SECTOR>(&bytes) {
        bail!("--store {}: is no store, though it has the length of one; name a new file", path.display());
    }
    // A board begins anew; here the file stays.
    if found(&bytes) == Some(StoreCondition::Unreadable) {
        bail!(
            "--store {}: is damaged: nothing in it can be read, and the run would begin it anew; move it away, or name a new file",
            path.display()
        );
    }
    Ok((bytes, Some(file)))
}

/// The state of delivery.
fn fill(mut file: &File, path: &Path) -> Result<()> {
    file.write_all(&vec![0xFF; BYTES]).with_context(|| cannot_write(path))
}

fn found(bytes: &[u8]) -> Option<StoreCondition> {
    Store::mount(SimFlash::<SECTOR>::with(bytes)).ok().map(|(_, found)| found)
}

#[derive(Clone, Debug)]
pub(super) struct FileFlash(Rc<RefCell<Inside>>);

#[derive(Debug)]
struct Inside {
    flash: SimFlash<SECTOR>,
    file: Option<File>,
    error: Option<io::Error>,
}

impl FileFlash {
    pub(super) fn cut_after(&self, steps: u64, seed: u64) {
        self.0.borrow_mut().flash.cut_after(steps, seed);
    }

    pub(super) fn is_dead(&self) -> bool {
        self.0.borrow().flash.is_dead()
    }

    /// All of it.
    pub(super) fn bytes(&self) -> Vec<u8> {
        self.0.borrow().flash.bytes().to_vec()
    }

    /// A store of empty flash: a first start would erase for half a second.
    pub(super) fn prepare(&self) -> Result<()> {
        if self.bytes().iter().any(|byte| *byte != 0xFF) {
            return Ok(());
        }
        Store::mount(self.clone()).map(drop).map_err(|error| anyhow!("the store cannot be made: {error:?}"))
    }

    pub(super) fn set(&self, bytes: &[u8]) {
        self.0.borrow_mut().flash = SimFlash::with(bytes);
        self.write_out(0, BYTES);
    }

    pub(super) fn take_error(&self) -> Option<io::Error> {
        self.0.borrow_mut().error.take()
    }

    fn write_out(&self, from: usize, to: usize) {
        let Inside { flash, file, error } = &mut *self.0.borrow_mut();
        let (Some(file), Some(bytes)) = (file, flash.bytes().get(from..to)) else { return };
        let written = file.seek(SeekFrom::Start(from as u64)).and_then(|_| file.write_all(bytes));
        if let Err(why) = written {
            error.get_or_insert(why);
        }
    }
}

impl ErrorType for FileFlash {
    type Error = NorFlashErrorKind;
}

impl ReadNorFlash for FileFlash {
    const READ_SIZE: usize = 1;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), NorFlashErrorKind> {
        self.0.borrow_mut().flash.read(offset, bytes)
    }

    fn capacity(&self) -> usize {
        BYTES
    }
}

impl NorFlash for FileFlash {
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SECTOR;

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), NorFlashErrorKind> {
        let outcome = self.0.borrow_mut().flash.write(offset, bytes);
        self.write_out(offset as usize, offset as usize + bytes.len());
        outcome
    }

    fn erase(&mut self, from: u32, to: u32) -> Result<(), NorFlashErrorKind> {
        let outcome = self.0.borrow_mut().flash.erase(from, to);
        self.write_out(from as usize, to as usize);
        outcome
    }
}
