//! Values that tasks share. An access masks all interrupts while it copies or changes the value: neither side waits.

use core::cell::RefCell;

use critical_section::Mutex;

/// A value that one task changes and others read, as a whole.
pub struct Shared<T>(Mutex<RefCell<T>>);

impl<T: Copy> Shared<T> {
    /// Begins with this value.
    pub const fn new(value: T) -> Self {
        Self(Mutex::new(RefCell::new(value)))
    }

    /// The present value.
    pub fn read(&self) -> T {
        critical_section::with(|cs| *self.0.borrow_ref(cs))
    }

    /// Changes it, and returns what `change` returns.
    pub fn change<R>(&self, change: impl FnOnce(&mut T) -> R) -> R {
        critical_section::with(|cs| change(&mut self.0.borrow_ref_mut(cs)))
    }
}

impl<T: Copy + Default> Default for Shared<T> {
    fn default() -> Self {
        Self::new(T::default())
    }
}
