//! Subscriptions: a data message's topic and its use.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::fields::{Slot, slots};
use super::format::Layout;
use super::px4::{self, Topic};
use super::rows;
use crate::source::counts::NamedCounts;
use crate::source::item::{Amount, MessageCount, Rows, Table};

/// At a time. PX4 has some 200.
const SUBSCRIPTIONS_MAX: usize = 4_096;
/// Of all tables, joined logs included. PX4 with all topics: 8,000.
const COLUMNS_MAX: usize = 32_768;
/// Of one table. PX4's widest, a foreign array of bytes, has 300.
const TABLE_COLUMNS_MAX: usize = 1_024;

/// A topic's instance.
#[derive(Debug)]
pub(super) struct Subscription {
    pub(super) layout: Arc<Layout>,
    pub(super) instance: u8,
    pub(super) topic: Option<(&'static Topic, Vec<Option<Slot>>)>,
    /// If rows are wanted.
    pub(super) table: Option<Arc<Table>>,
    pub(super) observed_us: Option<u64>,
    messages: Amount,
}

impl Subscription {
    /// Returns the message's time, if any.
    pub(super) fn take(&mut self, data: &[u8], message_bytes: usize) -> Option<u64> {
        self.messages.add(Amount { count: 1, bytes: message_bytes as u64 });
        self.time(data)
    }

    fn time(&self, data: &[u8]) -> Option<u64> {
        let at = self.layout.timestamp? as usize;
        Some(u64::from_le_bytes(*data.get(at..)?.first_chunk()?))
    }
}

/// All of them, by number.
#[derive(Debug, Default)]
pub(super) struct Subscriptions {
    numbered: Vec<Option<Box<Subscription>>>,
    living: usize,
    /// By topic, shared by its instances. A joined log may have other columns.
    tables: BTreeMap<String, Vec<Arc<Table>>>,
    /// Two topics may have one name (`a/b` and `a_b`).
    taken: BTreeSet<String>,
    columns: usize,
    counted: NamedCounts,
}

impl Subscriptions {
    /// Padding at the end may be left out.
    pub(super) fn fits(&self, id: u16, bytes: usize) -> Option<bool> {
        let layout = &self.numbered.get(usize::from(id))?.as_ref()?.layout;
        Some((layout.least_bytes..=layout.bytes).contains(&bytes))
    }

    pub(super) fn get_mut(&mut self, id: u16) -> Option<&mut Subscription> {
        self.numbered.get_mut(usize::from(id))?.as_deref_mut()
    }

    pub(super) fn time(&self, id: u16, data: &[u8]) -> Option<u64> {
        self.numbered.get(usize::from(id))?.as_ref()?.time(data)
    }

    pub(super) fn name(&self, id: usize) -> Option<&str> {
        Some(&self.numbered.get(id)?.as_ref()?.layout.name)
    }

    /// The error is the end of a sentence.
    pub(super) fn add(
        &mut self,
        id: u16,
        instance: u8,
        layout: &Arc<Layout>,
        rows: Rows<'_>,
    ) -> Result<(), &'static str> {
        self.remove(id);
        if self.living >= SUBSCRIPTIONS_MAX {
            return Err("one of too many");
        }
        self.living += 1;
        let topic = px4::topic(&layout.name).filter(|topic| instance < topic.instances);
        let has_rows = rows.has(&rows::table_name(layout));
        let table = has_rows.then(|| self.table(layout)).flatten();
        let is_left_out = has_rows && table.is_none();
        let subscription = Subscription {
            layout: Arc::clone(layout),
            instance,
            topic: topic.map(|topic| (topic, slots(layout, topic.fields))),
            table,
            observed_us: None,
            messages: Amount::default(),
        };
        let place = usize::from(id);
        if self.numbered.len() <= place {
            self.numbered.resize_with(place + 1, || None);
        }
        if let Some(slot) = self.numbered.get_mut(place) {
            *slot = Some(Box::new(subscription));
        }
        if is_left_out {
            Err("whose rows are left out: more columns than any log of PX4 has")
        } else {
            Ok(())
        }
    }

    /// Existing or new.
    fn table(&mut self, layout: &Layout) -> Option<Arc<Table>> {
        if rows::columns(layout) > TABLE_COLUMNS_MAX {
            return None;
        }
        let mut table = rows::table(layout);
        let tables = self.tables.entry(layout.name.clone()).or_default();
        if let Some(known) = tables.iter().find(|known| known.columns == table.columns) {
            return Some(Arc::clone(known));
        }
        self.columns += table.columns.len();
        if self.columns > COLUMNS_MAX {
            return None;
        }
        table.name = Table::free_name(&mut self.taken, &table.name);
        let table = Arc::new(table);
        tables.push(Arc::clone(&table));
        Some(table)
    }

    pub(super) fn remove(&mut self, id: u16) {
        let Some(gone) = self.numbered.get_mut(usize::from(id)).and_then(Option::take) else { return };
        self.living -= 1;
        self.counted.add(&gone.layout.name, gone.messages);
    }

    /// Another log begins.
    pub(super) fn clear(&mut self) {
        for gone in std::mem::take(&mut self.numbered).into_iter().flatten() {
            self.counted.add(&gone.layout.name, gone.messages);
        }
        self.living = 0;
    }

    pub(super) fn counts(mut self) -> Vec<MessageCount> {
        self.clear();
        self.counted.messages()
    }
}
