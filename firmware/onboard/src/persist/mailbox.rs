//! Items on their way from the monitor's task to the storage task.

use bbqueue::nicknames::Churrasco;
use bbqueue::prod_cons::framed::{FramedConsumer, FramedProducer};
use hums_core::lifetime::ITEM_BYTES_MAX;
use hums_store::{Key, VALUE_BYTES_MAX};

/// Its key.
const KEY_BYTES: usize = 4;
/// The longest item, and the queue's own two bytes.
const PLACE_BYTES: usize = KEY_BYTES + ITEM_BYTES_MAX + 2;
/// A queue of bytes must have room for the longest item before and behind its position; otherwise it can block for
/// ever.
const MAILBOX_BYTES: usize = (2 * PLACE_BYTES + 8).next_multiple_of(8);
const _: () = assert!(ITEM_BYTES_MAX <= VALUE_BYTES_MAX);

type Queue = Churrasco<MAILBOX_BYTES>;

/// Items on their way into the store; one static. When it is full the item stays with its owner.
pub struct Mailbox(Queue);

impl Default for Mailbox {
    fn default() -> Self {
        Self::new()
    }
}

impl Mailbox {
    /// Empty.
    pub const fn new() -> Self {
        Self(Queue::new())
    }

    /// Both ends, once.
    pub fn split(&self) -> (MailboxIn<'_>, MailboxOut<'_>) {
        (MailboxIn(self.0.framed_producer()), MailboxOut(self.0.framed_consumer()))
    }
}

/// The monitor's end.
pub struct MailboxIn<'a>(FramedProducer<&'a Queue>);

impl MailboxIn<'_> {
    /// `false` without room.
    pub fn put(&mut self, key: Key, value: &[u8]) -> bool {
        let length = KEY_BYTES + value.len();
        let Ok(mut grant) = self.0.grant(length as u16) else { return false };
        if let Some((place, rest)) = grant.split_at_mut_checked(KEY_BYTES) {
            place.copy_from_slice(&key.stored().to_le_bytes());
            if let Some(rest) = rest.get_mut(..value.len()) {
                rest.copy_from_slice(value);
            }
        }
        grant.commit(length as u16);
        true
    }
}

/// The store writer's end.
pub struct MailboxOut<'a>(FramedConsumer<&'a Queue>);

impl MailboxOut<'_> {
    /// `take` returns whether it is finished; `None` if there is none.
    pub(crate) fn oldest<R>(&mut self, take: impl FnOnce(Key, &[u8]) -> (R, bool)) -> Option<R> {
        let grant = self.0.read().ok()?;
        let Some((key, value)) = grant.split_first_chunk::<KEY_BYTES>() else {
            grant.release();
            return None;
        };
        let (result, done) = take(Key::from_stored(u32::from_le_bytes(*key)), value);
        if done {
            grant.release();
        }
        Some(result)
    }
}
