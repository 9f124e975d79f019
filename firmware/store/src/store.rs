//! The store itself: a map of keys to bytes.

use core::pin::pin;
use core::task::{Context, Poll, Waker};

use embedded_storage::nor_flash::{ErrorType, NorFlash};
use sequential_storage::cache::{Cache, Uncached};
use sequential_storage::map::{MapConfig, MapStorage, SerializationError, Value};

use crate::key::Key;
use crate::sectors::{Found, Refusal, SECTORS, Sectors};

/// The longest value.
pub const VALUE_BYTES_MAX: usize = 512;

/// A key, a value and the byte that ends it.
const BUFFER_BYTES: usize = (4 + VALUE_BYTES_MAX + 1).next_multiple_of(4);
/// What an item takes beside its value: its length and checks, its key, the byte that ends it.
const OVERHEAD_BYTES: usize = 8 + 4 + 1;
/// Ends each value, so that no item ends like erased flash and what is free can be told from what is not.
const END: u8 = 0;

/// The longest filler.
const ZEROS: [u8; VALUE_BYTES_MAX] = [0; VALUE_BYTES_MAX];

/// Nothing is remembered: looking through all of 16 KiB takes the processor some 6 ms, and whoever saves has time.
type Library<F> = MapStorage<u32, Sectors<F>, Cache<Uncached, Uncached, Uncached, u32>>;
type Trouble<F> = sequential_storage::Error<Refusal<<F as ErrorType>::Error>>;
type Outcome<T, F> = Result<T, Error<<F as ErrorType>::Error>>;

/// Why something was not stored, or not read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Error<E> {
    /// It would need an erase, and none is allowed now. Nothing changed.
    NotNow,
    /// Longer than [`VALUE_BYTES_MAX`].
    TooLong,
    /// All items together do not fit into one sector.
    Full,
    /// What is in the flash cannot be read.
    Unreadable,
    /// The flash itself.
    Flash(E),
}

/// What a save did.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Saved {
    /// The value was stored already.
    Unchanged,
    /// The value is stored.
    Written,
    /// The store was found unreadable and was made anew; this value is stored, all others are lost.
    Remade,
}

/// Items in two sectors of `F`.
pub struct Store<F: NorFlash> {
    library: Library<F>,
    buffer: [u8; BUFFER_BYTES],
}

impl<F: NorFlash> Store<F> {
    /// Starts with what is in the flash, which is two sectors; ends whatever power cut short, for which erases are
    /// allowed here. Afterwards they are not, until [`Self::allow_erase`].
    pub fn mount(flash: F) -> Outcome<(Self, Found), F> {
        let (sectors, mut found) = Sectors::mount(flash).map_err(refused::<F>)?;
        let config = const { MapConfig::new(0..(SECTORS * Sectors::<F>::PAGE_BYTES) as u32) };
        let library = MapStorage::new(sectors, config, Cache::new_uncached());
        let mut store = Self { library, buffer: [0; BUFFER_BYTES] };
        let look = store.library.flash().look().map_err(refused::<F>)?;
        if look.damaged > 0 || found == Found::Damaged {
            // Noise may look like a sector in use.
            found = if look.items > 0 { Found::Damaged } else { Found::Unreadable };
            if found == Found::Unreadable {
                store.library.flash().remake().map_err(refused::<F>)?;
            }
        }
        let mut mounts = [0; 4];
        if let Ok(Some(length)) = store.get(Key::MOUNTS, &mut mounts)
            && length != mounts.len()
        {
            mounts = [0; 4];
        }
        // A save makes the library look at everything, and repair it: now, when there is time.
        let count = u32::from_le_bytes(mounts).saturating_add(1);
        match store.save(Key::MOUNTS, &count.to_le_bytes()) {
            Ok(Saved::Remade) => found = Found::Unreadable,
            // A store that is full of items may stay so.
            Ok(_) | Err(Error::Full) => {}
            Err(error) => return Err(error),
        }
        if found == Found::Damaged {
            // Into the other sector, where what is damaged does not go along: it is told once. Where that fails the next start
            // tries again.
            let _ = store.turn_away();
        }
        store.allow_erase(false);
        Ok((store, found))
    }

    /// Whether an erase is allowed from now on: it may stop the processor for half a second.
    pub fn allow_erase(&mut self, allowed: bool) {
        self.library.flash().allow_erase(allowed);
    }

    /// Hands every stored item to `found`, the values of one key in the order in which they were stored: the last one
    /// counts.
    pub fn for_each(&mut self, mut found: impl FnMut(Key, &[u8])) -> Outcome<(), F> {
        self.for_each_stored(|key, value| {
            if !key.is_own() {
                found(key, value);
            }
        })
    }

    /// Copies a value into `out`; its length, or `None` where there is none or it is longer than `out`.
    pub fn get(&mut self, key: Key, out: &mut [u8]) -> Outcome<Option<usize>, F> {
        let Some(stored) = self.stored(key)? else { return Ok(None) };
        Ok(out.get_mut(..stored.len()).map(|out| {
            out.copy_from_slice(stored);
            stored.len()
        }))
    }

    /// Stores a value. When this returns an error the old value still stands.
    pub fn save(&mut self, key: Key, value: &[u8]) -> Outcome<Saved, F> {
        if value.len() > VALUE_BYTES_MAX {
            return Err(Error::TooLong);
        }
        // An error here comes again below, where something is done about it.
        if let Ok(Some(stored)) = self.stored(key)
            && stored == value
        {
            return Ok(Saved::Unchanged);
        }
        match self.write(key, value) {
            Err(Error::Unreadable) => {
                self.library.flash().remake().map_err(refused::<F>)?;
                self.write(key, value).map(|()| Saved::Remade)
            }
            outcome => outcome.map(|()| Saved::Written),
        }
    }

    /// Bytes that are free in the sector in use; an item takes 13 and its value, rounded up to 4.
    pub fn room(&mut self) -> Outcome<usize, F> {
        self.library.flash().room().map_err(refused::<F>)
    }

    /// How often the store was mounted since it was made, this time included.
    pub fn mounts(&mut self) -> Outcome<u32, F> {
        let mut mounts = [0; 4];
        self.get(Key::MOUNTS, &mut mounts)?;
        Ok(u32::from_le_bytes(mounts))
    }

    /// Goes on into the other sector now if less than `room` bytes are free, so that it need not be done later; whether
    /// it did. Takes an erase.
    pub fn turn_ahead(&mut self, room: usize) -> Outcome<bool, F> {
        /// The shortest filler, rounded up to a word.
        const SHORTEST: usize = OVERHEAD_BYTES.next_multiple_of(4);
        let before = self.library.flash().in_use().map_err(refused::<F>)?;
        if before.is_none() || self.room()? >= room {
            return Ok(false);
        }
        self.allow_erase(true);
        // Each filler takes half a kilobyte or all that is free, so that this ends after so many.
        let mut outcome = Ok(false);
        for _ in 0..F::ERASE_SIZE / VALUE_BYTES_MAX + 4 {
            let free = self.room()?;
            // The last one is short, for it goes along into the other sector.
            let spare = if free >= 2 * SHORTEST { SHORTEST + OVERHEAD_BYTES } else { OVERHEAD_BYTES };
            let filler = ZEROS.get(..free.saturating_sub(spare)).unwrap_or(&ZEROS);
            outcome = self.write(Key::FILLER, filler).map(|()| false);
            if outcome.is_err() || self.library.flash().in_use().map_err(refused::<F>)? != before {
                outcome = outcome.map(|_| true);
                break;
            }
        }
        self.allow_erase(false);
        outcome
    }

    /// Goes on into the other sector, however much of this one is free: what is damaged may lie there. Erases must be allowed.
    fn turn_away(&mut self) -> Outcome<(), F> {
        let before = self.library.flash().in_use().map_err(refused::<F>)?;
        for _ in 0..F::ERASE_SIZE / VALUE_BYTES_MAX + 4 {
            self.write(Key::FILLER, &ZEROS)?;
            if self.library.flash().in_use().map_err(refused::<F>)? != before {
                break;
            }
        }
        Ok(())
    }

    fn for_each_stored(&mut self, mut found: impl FnMut(Key, &[u8])) -> Outcome<(), F> {
        let Self { library, buffer } = self;
        let mut items = done(library.fetch_all_items(buffer)).map_err(troubled::<F>)?;
        while let Some((key, stored)) = done(items.next::<&[u8]>(buffer)).map_err(troubled::<F>)? {
            if let Some((_end, value)) = stored.split_last() {
                found(Key::from_stored(key), value);
            }
        }
        Ok(())
    }

    fn stored(&mut self, key: Key) -> Outcome<Option<&[u8]>, F> {
        let Self { library, buffer } = self;
        let stored = done(library.fetch_item::<&[u8]>(buffer, &key.stored())).map_err(troubled::<F>)?;
        Ok(stored.and_then(|stored| stored.split_last()).map(|(_, value)| value))
    }

    fn write(&mut self, key: Key, value: &[u8]) -> Outcome<(), F> {
        let Self { library, buffer } = self;
        done(library.store_item(buffer, &key.stored(), &Ended(value))).map_err(troubled::<F>)
    }
}

/// A value with the byte that ends it.
struct Ended<'a>(&'a [u8]);

impl<'a> Value<'a> for Ended<'a> {
    fn serialize_into(&self, buffer: &mut [u8]) -> Result<usize, SerializationError> {
        let length = self.0.len();
        let place = buffer.get_mut(..=length).and_then(<[u8]>::split_last_mut);
        let (end, value) = place.ok_or(SerializationError::BufferTooSmall)?;
        value.copy_from_slice(self.0);
        *end = END;
        Ok(length + 1)
    }

    fn deserialize_from(buffer: &'a [u8]) -> Result<(Self, usize), SerializationError> {
        Ok((Self(buffer), buffer.len()))
    }
}

/// The library is written for flash that is waited for; ours is done when it returns, so each future is ready at once.
fn done<T>(future: impl Future<Output = T>) -> T {
    let mut future = pin!(future);
    loop {
        if let Poll::Ready(result) = future.as_mut().poll(&mut Context::from_waker(Waker::noop())) {
            return result;
        }
    }
}

fn troubled<F: NorFlash>(error: Trouble<F>) -> Error<F::Error> {
    match error {
        sequential_storage::Error::Storage { value } => refused::<F>(value),
        sequential_storage::Error::FullStorage => Error::Full,
        sequential_storage::Error::ItemTooBig => Error::TooLong,
        // A buffer of ours is never too small for an item of ours.
        _ => Error::Unreadable,
    }
}

fn refused<F: NorFlash>(refusal: Refusal<F::Error>) -> Error<F::Error> {
    match refusal {
        Refusal::NotNow => Error::NotNow,
        Refusal::OutOfBounds => Error::Unreadable,
        Refusal::Flash(error) => Error::Flash(error),
    }
}
