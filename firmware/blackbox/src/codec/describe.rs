//! From a message's layout to the elements of its slot.

use hums_dialect::wire::PAYLOAD_BYTES_MAX;
use hums_dialect::{Field, Kind, Message, Role};

use super::body::Body;
use super::element::{Element, ElementKind};
use super::links;
use super::slots::{INSTANCE_BYTES, Key, Slot};

/// Arrays of this many bytes or more are data, not numbers.
const DATA_BYTES: usize = 16;

pub(super) fn instance_of(message: &Message) -> Option<(usize, usize)> {
    let mut offset = 0;
    for field in message.fields {
        if field.role == Role::Instance {
            return (field.size() <= INSTANCE_BYTES).then_some((offset, field.size()));
        }
        offset += field.size();
    }
    None
}

fn elements_of(field: &Field) -> (ElementKind, u8, u8) {
    let whole = |what| (what, 1, field.size() as u8);
    if field.role == Role::Instance && field.size() <= INSTANCE_BYTES {
        return whole(ElementKind::Instance);
    }
    let what = match (field.kind, field.role) {
        (Kind::Char, _) => return whole(ElementKind::Text),
        (Kind::U8 | Kind::I8, _) if field.count() >= DATA_BYTES => return whole(ElementKind::Text),
        (Kind::U8 | Kind::I8, _) => ElementKind::Integer1,
        (Kind::U16 | Kind::I16, _) => ElementKind::Integer2,
        (Kind::F32, _) => ElementKind::Float,
        (Kind::U32 | Kind::I32, Role::Millis) => ElementKind::Millis,
        (Kind::U32 | Kind::I32, Role::Micros) => ElementKind::Micros,
        (Kind::U32 | Kind::I32, _) => ElementKind::Integer4,
        (_, Role::Millis | Role::Micros) => ElementKind::WideTime,
        _ => ElementKind::Wide,
    };
    (what, field.count() as u8, field.kind.size() as u8)
}

impl Body {
    pub(super) fn describe(&mut self, key: Key, message: Option<&Message>) -> Slot {
        let (mut count, mut described) = (0, 0);
        for field in message.map_or(&[][..], |message| message.fields) {
            let (what, elements, _) = elements_of(field);
            count += usize::from(elements) * if what.is_wide() { 2 } else { 1 };
            described += field.size();
        }
        let fits = u8::try_from(count).is_ok() && described <= PAYLOAD_BYTES_MAX;
        let room = message.filter(|_| fits).and_then(|message| Some((message, self.elements.claim(count)?)));
        let Some((message, first)) = room else {
            let mut slot = Slot::new(key, None, 0, 0);
            if let Some(message) = message {
                slot.seed = message.crc_extra;
                (slot.verified, slot.own_seed) = (true, true);
            }
            return slot;
        };
        self.prepare(message, usize::from(first));
        let mut slot = Slot::new(key, Some(message), first, described);
        slot.elements_count = count as u8;
        slot
    }

    fn prepare(&mut self, message: &Message, first: usize) {
        let (mut at, mut end) = (first, 0);
        for field in message.fields {
            let (what, count, size) = elements_of(field);
            for _ in 0..count {
                let row = links::row_of(message.id, end);
                end += usize::from(size);
                let detail =
                    if matches!(what, ElementKind::Text | ElementKind::Instance) { size } else { row };
                let mut element = Element::new(what, detail, end as u8);
                if what == ElementKind::Integer2 || what == ElementKind::Integer4 {
                    element.exponent = u8::from(matches!(field.kind, Kind::I16 | Kind::I32));
                }
                let upper = Element::new(ElementKind::Upper, 0, end as u8);
                for (place, element) in self.elements.list.iter_mut().skip(at).zip([element, upper]) {
                    *place = element;
                }
                at += if what.is_wide() { 2 } else { 1 };
            }
        }
    }
}
