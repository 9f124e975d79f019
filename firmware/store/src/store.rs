//! The store itself: a map of keys to bytes.

use embedded_storage::nor_flash::{ErrorType, NorFlash};

use crate::key::Key;
use crate::sector::{Content, HEADER_BYTES, Header, ITEM_BYTES, Item, Sector, WORD};

/// The longest value.
pub const VALUE_BYTES_MAX: usize = 512;

type Outcome<T, F> = Result<T, Error<<F as ErrorType>::Error>>;

/// Error of a save or a read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Error<E> {
    /// An erase is needed and not allowed now. Nothing changed.
    NotNow,
    /// Longer than [`VALUE_BYTES_MAX`].
    TooLong,
    /// All items together do not fit into one sector.
    Full,
    /// Error of the flash.
    Flash(E),
}

impl<E> From<E> for Error<E> {
    fn from(error: E) -> Self {
        Self::Flash(error)
    }
}

/// Result of a save.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SaveResult {
    /// The value was stored already.
    Unchanged,
    /// The value is stored.
    Written,
}

/// State of the flash at a start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StoreCondition {
    /// An intact store.
    Kept,
    /// A store with damaged items. Of these the previous value counts, or none.
    Damaged,
    /// Erased flash, never used.
    Blank,
    /// Unreadable contents. All items are lost and a new store was created.
    Unreadable,
}

/// Items in flash `F` of exactly two sectors.
pub struct Store<F: NorFlash> {
    flash: F,
    /// Its generation, and the next item's offset.
    in_use: usize,
    generation: u16,
    end: usize,
    may_erase: bool,
}

impl<F: NorFlash> Store<F> {
    /// Opens the store and completes an interrupted change of sectors; erases are allowed here. Later erases need
    /// [`Self::allow_erase`].
    pub fn mount(flash: F) -> Outcome<(Self, StoreCondition), F> {
        let mut store = Self { flash, in_use: 0, generation: 0, end: 0, may_erase: true };
        let found = store.choose()?;
        let count = store.mounts()?.saturating_add(1);
        match store.save(Key::MOUNTS, &count.to_le_bytes()) {
            // A full store may stay full.
            Ok(_) | Err(Error::Full) => {}
            Err(error) => return Err(error),
        }
        match found {
            StoreCondition::Kept => {}
            // Damaged items are not copied, so they are reported once. If this fails, the next start tries again.
            StoreCondition::Damaged => drop(store.turn()),
            StoreCondition::Blank | StoreCondition::Unreadable => store.current().complete()?,
        }
        store.may_erase = false;
        Ok((store, found))
    }

    /// Selects the newer complete sector. If it is marked as superseded by the other one, the other header is damaged; the items
    /// of the other sector count.
    fn choose(&mut self) -> Outcome<StoreCondition, F> {
        let headers = [self.sector(0).header()?, self.sector(1).header()?];
        let contents = [self.sector(0).content()?, self.sector(1).content()?];
        let generation = |index: usize| headers[index].generation.filter(|_| headers[index].is_complete);
        let newer = usize::from(generation(1) > generation(0));
        let is_superseded =
            |header: &Header| header.superseded_by.is_some_and(|by| Some(by) > header.generation);
        let more = usize::from(contents[1].items > contents[0].items);
        let (chosen, is_whole) = match generation(newer) {
            Some(_) if is_superseded(&headers[newer]) && contents[1 - newer].items > 0 => (1 - newer, false),
            Some(_) => (newer, !is_superseded(&headers[newer])),
            None => (more, false),
        };
        let Content { items, is_damaged, end } = contents[chosen];
        (self.in_use, self.end) = (chosen, end);
        self.generation = headers.iter().filter_map(|header| header.generation).max().unwrap_or(0);
        if items > 0 {
            return Ok(if is_whole && !is_damaged { StoreCondition::Kept } else { StoreCondition::Damaged });
        }
        let is_empty = contents.iter().all(|content| content.end == HEADER_BYTES);
        // A complete sector has at least one item. Without any, all items are lost.
        let found = match headers.iter().any(|header| header.is_complete) {
            _ if !is_empty => StoreCondition::Unreadable,
            true => StoreCondition::Damaged,
            false => StoreCondition::Blank,
        };
        for index in [1, 0] {
            self.sector(index).begin(1)?;
        }
        (self.in_use, self.generation, self.end) = (0, 1, HEADER_BYTES);
        Ok(found)
    }

    const fn sector(&mut self, index: usize) -> Sector<'_, F> {
        Sector::new(&mut self.flash, index, F::ERASE_SIZE)
    }

    const fn current(&mut self) -> Sector<'_, F> {
        Sector::new(&mut self.flash, self.in_use, self.end)
    }

    /// Allows or forbids erases. An erase may stop the processor for 0.5 s.
    pub const fn allow_erase(&mut self, allowed: bool) {
        self.may_erase = allowed;
    }

    /// Passes every stored item to `found`, oldest first. The last value of each key counts.
    pub fn for_each(&mut self, mut found: impl FnMut(Key, &[u8])) -> Outcome<(), F> {
        let (mut at, mut value) = (HEADER_BYTES, [0; VALUE_BYTES_MAX]);
        while let Some(item) = self.current().next(at)? {
            at = item.end();
            if let Some(value) = value.get_mut(..item.length).filter(|_| !item.key.is_own()) {
                self.current().read(item.value_at(), value)?;
                found(item.key, value);
            }
        }
        Ok(())
    }

    /// Copies a value into `out` and returns its length. `None` without a value, or if `out` is too short.
    pub fn get(&mut self, key: Key, out: &mut [u8]) -> Outcome<Option<usize>, F> {
        let Some(item) = self.find(key)? else { return Ok(None) };
        let Some(out) = out.get_mut(..item.length) else { return Ok(None) };
        self.current().read(item.value_at(), out)?;
        Ok(Some(item.length))
    }

    fn find(&mut self, key: Key) -> Outcome<Option<Item>, F> {
        let (mut found, mut at) = (None, HEADER_BYTES);
        while let Some(item) = self.current().next(at)? {
            at = item.end();
            if item.key == key {
                found = Some(item);
            }
        }
        Ok(found)
    }

    /// After an error the old value is still stored.
    pub fn save(&mut self, key: Key, value: &[u8]) -> Outcome<SaveResult, F> {
        if value.len() > VALUE_BYTES_MAX {
            return Err(Error::TooLong);
        }
        if let Some(item) = self.find(key)?
            && self.current().holds(&item, value)?
        {
            return Ok(SaveResult::Unchanged);
        }
        let bytes = ITEM_BYTES + value.len().next_multiple_of(WORD);
        if bytes > F::ERASE_SIZE - self.end {
            if HEADER_BYTES + self.live_bytes()? + bytes > F::ERASE_SIZE {
                return Err(Error::Full);
            }
            if !self.may_erase {
                return Err(Error::NotNow);
            }
            self.turn()?;
        }
        let at = self.end;
        self.end += bytes;
        self.current().append(at, key, value)?;
        Ok(SaveResult::Written)
    }

    /// Free bytes of the active sector. An item takes 12 bytes and its value, rounded up to 4.
    pub const fn room(&self) -> usize {
        F::ERASE_SIZE.saturating_sub(self.end)
    }

    /// Mounts since its creation, this one included.
    pub fn mounts(&mut self) -> Outcome<u32, F> {
        let mut mounts = [0; 4];
        self.get(Key::MOUNTS, &mut mounts)?;
        Ok(u32::from_le_bytes(mounts))
    }

    /// Changes to the other sector if less than `room` bytes are free and the change gains space. Returns whether it did. Needs
    /// an erase.
    pub fn turn_ahead(&mut self, room: usize) -> Outcome<bool, F> {
        if self.room() >= room || HEADER_BYTES + self.live_bytes()? >= self.end {
            return Ok(false);
        }
        self.turn().map(|()| true)
    }

    fn live_bytes(&mut self) -> Outcome<usize, F> {
        let (mut bytes, mut at) = (0, HEADER_BYTES);
        while let Some(item) = self.current().next(at)? {
            at = item.end();
            bytes += if self.current().is_newest(&item)? { item.bytes() } else { 0 };
        }
        Ok(bytes)
    }

    fn turn(&mut self) -> Outcome<(), F> {
        let (from, to) = (self.in_use, 1 - self.in_use);
        let generation = self.generation.saturating_add(1);
        self.sector(to).begin(generation)?;
        let (mut at, mut end) = (HEADER_BYTES, HEADER_BYTES);
        while let Some(item) = self.current().next(at)? {
            at = item.end();
            if !self.current().is_newest(&item)? {
                continue;
            }
            for place in (0..item.bytes()).step_by(WORD) {
                let word = self.current().word(item.at + place)?;
                self.sector(to).write_word(end + place, word)?;
            }
            end += item.bytes();
        }
        self.sector(to).complete()?;
        (self.in_use, self.generation, self.end) = (to, generation, end);
        self.sector(from).supersede(generation)?;
        Ok(())
    }
}
