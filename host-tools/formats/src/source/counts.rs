//! Messages by id and by name.

use std::collections::BTreeMap;

use super::item::{Amount, MessageCount};
use crate::names::message_name;

/// Ids in a table: most ids are small.
const NEAR: usize = 1024;
/// Counted one by one: there are 16 million.
const FAR_MAX: usize = 4_096;

/// Frames by id, and by whether the checksum matches our definition.
#[derive(Debug)]
pub(super) struct Counts {
    near: Vec<Amount>,
    far: BTreeMap<(u32, bool), Amount>,
    other: Amount,
}

impl Counts {
    pub(super) fn new() -> Self {
        Self { near: vec![Amount::default(); NEAR], far: BTreeMap::new(), other: Amount::default() }
    }

    pub(super) fn add(&mut self, id: u32, verified: bool, bytes: usize) {
        self.place((id, verified)).add(Amount { count: 1, bytes: bytes as u64 });
    }

    pub(super) fn and(&mut self, next: &Self) {
        self.near.iter_mut().zip(&next.near).for_each(|(count, more)| count.add(*more));
        next.far.iter().for_each(|(key, more)| self.place(*key).add(*more));
        self.other.add(next.other);
    }

    pub(super) fn messages(self) -> (Vec<MessageCount>, Amount) {
        let near = (0_u32..).zip(self.near).filter(|(_, amount)| amount.count > 0);
        let near = near.map(|(place, amount)| ((place >> 1, place & 1 != 0), amount));
        let message = |((id, verified), amount)| MessageCount {
            id: Some((id, verified)),
            name: message_name(id).into_owned(),
            amount,
        };
        (near.chain(self.far).map(message).collect(), self.other)
    }

    fn place(&mut self, key: (u32, bool)) -> &mut Amount {
        let (id, verified) = key;
        match self.near.get_mut((id as usize) << 1 | usize::from(verified)) {
            Some(amount) => amount,
            None if self.far.len() >= FAR_MAX && !self.far.contains_key(&key) => &mut self.other,
            None => self.far.entry(key).or_default(),
        }
    }
}

/// Counted by themselves: a file may define names for ever.
const NAMES_MAX: usize = 4_096;
const OTHERS: &str = "others";

/// Messages by name.
#[derive(Debug, Default)]
pub(super) struct NamedCounts(BTreeMap<String, Amount>);

impl NamedCounts {
    pub(super) fn add(&mut self, name: &str, amount: Amount) {
        let room = self.0.len() < NAMES_MAX || self.0.contains_key(name);
        self.0.entry(if room { name } else { OTHERS }.to_owned()).or_default().add(amount);
    }

    pub(super) fn messages(self) -> Vec<MessageCount> {
        self.0.into_iter().map(|(name, amount)| MessageCount { id: None, name, amount }).collect()
    }
}
