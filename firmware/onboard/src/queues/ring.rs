//! A ring of places from one task to another.

use core::cell::UnsafeCell;
use core::slice;
use core::sync::atomic::{AtomicUsize, Ordering};

/// Places from one task to another, filled and read where they lie. Neither end waits.
///
/// The places from the reader's position on that are counted in `waiting` belong to [`Out`], the others to [`In`].
pub(crate) struct Ring<T, const PLACES: usize> {
    places: UnsafeCell<[T; PLACES]>,
    waiting: AtomicUsize,
}

// SAFETY: `split` gives out one end of each kind, and each place belongs to one end at a time.
unsafe impl<T: Send, const PLACES: usize> Sync for Ring<T, PLACES> {}

impl<T, const PLACES: usize> Ring<T, PLACES> {
    pub(crate) const fn new(places: [T; PLACES]) -> Self {
        Self { places: UnsafeCell::new(places), waiting: AtomicUsize::new(0) }
    }

    pub(crate) fn split(&mut self) -> (In<'_, T, PLACES>, Out<'_, T, PLACES>) {
        *self.waiting.get_mut() = 0;
        (In { ring: self, next: 0 }, Out { ring: self, first: 0 })
    }

    fn len(&self) -> usize {
        self.waiting.load(Ordering::Acquire)
    }

    /// # Safety
    /// These places must lie in the ring and belong to the caller for `'a`.
    unsafe fn places<'a>(&self, from: usize, count: usize) -> &'a mut [T] {
        // SAFETY: by this function's contract.
        unsafe { slice::from_raw_parts_mut(self.places.get().cast::<T>().add(from), count) }
    }
}

/// The writing end.
pub(crate) struct In<'a, T, const PLACES: usize> {
    ring: &'a Ring<T, PLACES>,
    next: usize,
}

impl<T, const PLACES: usize> In<'_, T, PLACES> {
    /// With those that are being read.
    pub(crate) fn len(&self) -> usize {
        self.ring.len()
    }

    /// Filled places are handed over with [`Self::commit`].
    pub(crate) fn free(&mut self) -> Option<&mut T> {
        if self.len() >= PLACES {
            return None;
        }
        // SAFETY: `next` is below `PLACES`, and the place is free until `commit`.
        unsafe { self.ring.places(self.next, 1) }.first_mut()
    }

    pub(crate) fn commit(&mut self) {
        if self.len() < PLACES {
            self.next = (self.next + 1) % PLACES;
            self.ring.waiting.fetch_add(1, Ordering::AcqRel);
        }
    }
}

/// The reading end.
pub(crate) struct Out<'a, T, const PLACES: usize> {
    ring: &'a Ring<T, PLACES>,
    first: usize,
}

impl<T, const PLACES: usize> Out<'_, T, PLACES> {
    /// Filled places.
    pub(crate) fn len(&self) -> usize {
        self.ring.len()
    }

    pub(crate) fn waiting(&mut self) -> &mut [T] {
        let count = self.len().min(PLACES - self.first);
        // SAFETY: `first` is below `PLACES`, and these places are counted as filled until `release`.
        unsafe { self.ring.places(self.first, count) }
    }

    /// Frees the oldest places, at most those of [`Self::waiting`].
    pub(crate) fn release(&mut self, count: usize) {
        let count = count.min(self.len()).min(PLACES - self.first);
        self.first = (self.first + count) % PLACES;
        self.ring.waiting.fetch_sub(count, Ordering::AcqRel);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn put<T, const PLACES: usize>(to: &mut In<'_, T, PLACES>, value: T) -> bool {
        let Some(place) = to.free() else { return false };
        *place = value;
        to.commit();
        true
    }

    #[test]
    fn all_places_hold_and_come_out_in_order_from_any_position() {
        let mut ring = Ring::<u32, 3>::new([0; 3]);
        let (mut to, mut from) = ring.split();
        let (mut given, mut seen) = (0, 0);
        for count in [1, 3, 2, 3, 3, 1] {
            for _ in 0..count {
                assert!(put(&mut to, given));
                given += 1;
            }
            assert_eq!((to.len(), from.len()), (count, count));
            assert_eq!(to.free().is_none(), count == 3);
            while from.len() > 0 {
                let waiting = from.waiting();
                let in_row = waiting.len();
                assert!(in_row > 0);
                for place in waiting {
                    assert_eq!(*place, seen);
                    seen += 1;
                }
                from.release(in_row);
            }
            assert!(from.waiting().is_empty());
        }
        assert_eq!(given, seen);
    }

    #[test]
    fn no_more_is_handed_over_than_there_are_places_and_no_more_freed_than_wait() {
        let mut ring = Ring::<u32, 2>::new([0; 2]);
        let (mut to, mut from) = ring.split();
        assert!(to.free().is_some() && from.waiting().is_empty(), "not handed over");
        from.release(1);
        assert!(put(&mut to, 7) && put(&mut to, 8) && !put(&mut to, 9));
        to.commit();
        assert_eq!(from.waiting(), [7, 8]);
        from.release(3);
        assert_eq!((from.len(), to.len()), (0, 0));
    }

    #[test]
    fn each_value_passes_once_between_two_threads() {
        const VALUES: u32 = 20_000;
        let mut ring = Ring::<[u32; 4], 5>::new([[0; 4]; 5]);
        let (mut to, mut from) = ring.split();
        std::thread::scope(|scope| {
            scope.spawn(move || {
                for value in 0..VALUES {
                    while !put(&mut to, [value; 4]) {
                        std::thread::yield_now();
                    }
                }
            });
            let mut expected = 0;
            while expected < VALUES {
                let waiting = from.waiting();
                let count = waiting.len();
                for place in waiting {
                    assert_eq!(*place, [expected; 4]);
                    expected += 1;
                }
                from.release(count);
                std::thread::yield_now();
            }
        });
    }
}
