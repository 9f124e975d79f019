//! Items on their way from the monitor's task to the storage task.

use hums_core::lifetime::ITEM_BYTES_MAX;
use hums_store::{Key, VALUE_BYTES_MAX};

use crate::queues::ring::{In, Out, Ring};

const _: () = assert!(ITEM_BYTES_MAX <= VALUE_BYTES_MAX);

struct Item {
    key: Key,
    length: usize,
    bytes: [u8; ITEM_BYTES_MAX],
}

/// The item on its way into the store. While it waits, all others stay with their owners.
pub struct Mailbox(Ring<Item, 1>);

impl Mailbox {
    /// Empty.
    pub const fn new() -> Self {
        Self(Ring::new([Item { key: Key::from_stored(0), length: 0, bytes: [0; ITEM_BYTES_MAX] }]))
    }

    /// Both ends, once.
    pub fn split(&mut self) -> (MailboxIn<'_>, MailboxOut<'_>) {
        let (to, from) = self.0.split();
        (MailboxIn(to), MailboxOut(from))
    }
}

/// The monitor's end.
pub struct MailboxIn<'a>(In<'a, Item, 1>);

impl MailboxIn<'_> {
    /// Hands over the item that `encode` writes, of the returned length; `false` if another one waits.
    pub(super) fn put(&mut self, key: Key, encode: impl FnOnce(&mut [u8; ITEM_BYTES_MAX]) -> usize) -> bool {
        let Some(item) = self.0.free() else { return false };
        (item.key, item.length) = (key, encode(&mut item.bytes));
        self.0.commit();
        true
    }

    /// Whether the writer has finished with the last item.
    pub(super) fn is_empty(&self) -> bool {
        self.0.len() == 0
    }
}

/// The store writer's end.
pub struct MailboxOut<'a>(Out<'a, Item, 1>);

impl MailboxOut<'_> {
    /// The waiting item.
    pub(super) fn waiting(&mut self) -> Option<(Key, &[u8])> {
        let item = self.0.waiting().first()?;
        Some((item.key, item.bytes.get(..item.length).unwrap_or_default()))
    }

    pub(super) fn release(&mut self) {
        self.0.release(1);
    }
}
