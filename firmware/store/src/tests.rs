//! Behaviour of the store without power cuts.

use embedded_storage::nor_flash::{NorFlash as _, NorFlashErrorKind};

use crate::sim::SimFlash;
use crate::{Error, Key, SaveResult, Store, StoreCondition, VALUE_BYTES_MAX, param, param_value};

type Flash = SimFlash<16384>;

fn mounted(flash: &mut Flash) -> (Store<&mut Flash>, StoreCondition) {
    Store::mount(flash).expect("this flash works")
}

fn value<'b>(store: &mut Store<&mut Flash>, key: Key, buffer: &'b mut [u8]) -> Option<&'b [u8]> {
    let length = store.get(key, buffer).expect("readable")?;
    Some(&buffer[..length])
}

#[test]
fn what_is_saved_is_there_at_the_next_start_and_starts_are_counted() {
    let mut flash = Flash::blank();
    let mut buffer = [0; VALUE_BYTES_MAX];
    {
        let (mut store, found) = mounted(&mut flash);
        assert_eq!((found, store.mounts()), (StoreCondition::Blank, Ok(1)));
        assert_eq!(value(&mut store, Key::item(1), &mut buffer), None);
        assert_eq!(store.save(Key::item(1), &[1, 2, 3]), Ok(SaveResult::Written));
        assert_eq!(store.save(Key::item(1), &[1, 2]), Ok(SaveResult::Written));
        assert_eq!(store.save(Key::item(2), &[0xFF; VALUE_BYTES_MAX]), Ok(SaveResult::Written));
        assert_eq!(store.save(Key::item(2), &[0; VALUE_BYTES_MAX + 1]), Err(Error::TooLong));
    }
    let (mut store, found) = mounted(&mut flash);
    assert_eq!((found, store.mounts()), (StoreCondition::Kept, Ok(2)));
    assert_eq!(value(&mut store, Key::item(1), &mut buffer), Some(&[1, 2][..]));
    assert_eq!(value(&mut store, Key::item(2), &mut buffer), Some(&[0xFF; VALUE_BYTES_MAX][..]));
    assert_eq!(value(&mut store, Key::item(2), &mut [0; 9]), None, "no room for it");
}

#[test]
fn a_value_that_is_there_already_costs_nothing() {
    let mut flash = Flash::blank();
    let (mut store, _) = mounted(&mut flash);
    store.save(Key::item(1), b"same").expect("room");
    let room = store.room();
    assert_eq!(store.save(Key::item(1), b"same"), Ok(SaveResult::Unchanged));
    assert_eq!(store.room(), room);
    assert_eq!(store.save(Key::item(1), b"other"), Ok(SaveResult::Written));
    assert_eq!(store.room(), room - 20, "12 and 5 bytes are five words");
}

#[test]
fn parameters_are_found_by_name() {
    let mut flash = Flash::blank();
    let (mut store, _) = mounted(&mut flash);
    for (name, number) in [("ONE", 1.0), ("TWO", 2.0), ("ONE", 1.5)] {
        let (bytes, length) = param_value(name, number).expect("short");
        store.save(Key::param(name), &bytes[..length]).expect("room");
    }
    store.save(Key::item(9), b"no parameter").expect("room");
    let mut seen = Vec::new();
    let see = |key: Key, value: &[u8]| {
        if key.is_param() {
            seen.extend(param(value).map(|(name, value)| (name.to_owned(), value)));
        }
    };
    store.for_each(see).expect("readable");
    assert_eq!(seen, [("ONE".into(), 1.0), ("TWO".into(), 2.0), ("ONE".into(), 1.5)], "the last one counts");
}

#[test]
fn a_save_that_needs_an_erase_waits_until_it_is_allowed_and_changes_nothing() {
    let mut flash = Flash::blank();
    let (mut store, _) = mounted(&mut flash);
    let mut number: u16 = 0;
    let refused = loop {
        match store.save(Key::item(1), &[number.to_le_bytes(); 100].concat()) {
            Ok(_) => number += 1,
            Err(error) => break error,
        }
    };
    assert_eq!(refused, Error::NotNow);
    assert_eq!(number, 77, "items of 212 bytes in 16 KiB, beside what the store keeps for itself");
    let mut buffer = [0; VALUE_BYTES_MAX];
    let last = [(number - 1).to_le_bytes(); 100].concat();
    assert_eq!(value(&mut store, Key::item(1), &mut buffer), Some(&last[..]));
    assert_eq!(store.save(Key::item(2), b"still fits"), Ok(SaveResult::Written));
    store.allow_erase(true);
    assert_eq!(store.save(Key::item(1), b"new"), Ok(SaveResult::Written));
    assert_eq!(store.save(Key::item(1), &[number as u8; 200]), Ok(SaveResult::Written));
    assert!(store.room() > 15_000);
    assert_eq!(flash.erases(), 3);
}

#[test]
fn the_other_sector_is_begun_ahead_when_little_is_free() {
    let mut flash = Flash::blank();
    let (mut store, _) = mounted(&mut flash);
    assert_eq!(store.turn_ahead(8_192), Ok(false), "it has just been made");
    for number in 0..30_u8 {
        store.save(Key::item(number % 4), &[number; 300]).expect("room");
    }
    let room = store.room();
    assert!(room < 8_192, "{room}");
    assert_eq!(store.turn_ahead(room), Ok(false));
    assert_eq!(store.turn_ahead(8_192), Ok(true));
    let room = store.room();
    assert!(room > 16_384 - 4 * 320 - 100, "four items went along, and nothing big beside: {room}");
    let mut buffer = [0; VALUE_BYTES_MAX];
    for number in 26..30_u8 {
        assert_eq!(value(&mut store, Key::item(number % 4), &mut buffer), Some(&[number; 300][..]));
    }
    // Nor does it leave erases allowed.
    let mut saves = (0..100).map(|number| store.save(Key::item(9), &[number; 500]));
    assert_eq!(saves.find(Result::is_err), Some(Err(Error::NotNow)));
}

#[test]
fn it_turns_at_any_fill() {
    let mut flash = Flash::blank();
    for fill in 0..700_usize {
        let (mut store, found) = mounted(&mut flash);
        assert_ne!(found, StoreCondition::Unreadable);
        store.save(Key::item(1), &[fill as u8; 77]).expect("room");
        store.save(Key::item(2), &vec![fill as u8; fill % 400]).expect("room");
        store.turn_ahead(16_000 - 2 * fill).expect("it turns");
        let mut buffer = [0; VALUE_BYTES_MAX];
        assert_eq!(value(&mut store, Key::item(1), &mut buffer), Some(&[fill as u8; 77][..]), "{fill}");
    }
}

#[test]
fn more_than_fits_is_refused_and_what_is_there_stays() {
    let mut flash = Flash::blank();
    let (mut store, _) = mounted(&mut flash);
    store.allow_erase(true);
    let mut number = 0;
    let refused = loop {
        match store.save(Key::item(number), &[number; 512]) {
            Ok(SaveResult::Written) => number += 1,
            outcome => break outcome,
        }
    };
    assert_eq!((refused, number), (Err(Error::Full), 31));
    let mut buffer = [0; VALUE_BYTES_MAX];
    for number in 0..31 {
        assert_eq!(value(&mut store, Key::item(number), &mut buffer), Some(&[number; 512][..]), "{number}");
    }
    let (mut store, found) = mounted(&mut flash);
    assert_eq!(found, StoreCondition::Kept);
    assert_eq!(value(&mut store, Key::item(29), &mut buffer), Some(&[29; 512][..]));
}

#[test]
fn whatever_is_in_the_flash_it_is_told_made_anew_and_works() {
    let mut word: u32 = 1;
    let mut noise = |bytes: &mut [u8]| {
        for byte in bytes {
            word = word.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            *byte = (word >> 24) as u8;
        }
    };
    for run in 0..400 {
        let mut bytes = vec![0; 2 * 16_384];
        match run {
            0 => {}
            1 => bytes.fill(0x5A),
            _ => noise(&mut bytes),
        }
        if run % 4 == 3 {
            // Valid headers, random contents.
            bytes[..8].copy_from_slice(&[0x32, 0x54, 0x53, 0x48, 9, 0, 0xF6, 0xFF]);
            bytes[16_384..16_392].copy_from_slice(&[0x32, 0x54, 0x53, 0x48, 3, 0, 0xFC, 0xFF]);
            for sector in [0, 16_384] {
                bytes[sector + 8..sector + 12].copy_from_slice(b"enod");
                bytes[sector + 12..sector + 16].fill(0xFF);
            }
        }
        let mut flash = Flash::with(&bytes);
        let (mut store, found) = mounted(&mut flash);
        if run % 4 != 3 {
            assert_eq!(found, StoreCondition::Unreadable, "{run}");
        }
        store.for_each(|key, value| panic!("{run}: {key:?} {value:?} out of noise")).expect("readable");
        store.allow_erase(true);
        store.save(Key::item(1), b"works").expect("room");
        let (mut store, found) = mounted(&mut flash);
        assert_eq!((found, store.mounts()), (StoreCondition::Kept, Ok(2)), "{run}");
        assert_eq!(value(&mut store, Key::item(1), &mut [0; 5]), Some(&b"works"[..]), "{run}");
    }
}

#[test]
fn one_sector_that_is_overwritten_is_told() {
    let mut flash = Flash::blank();
    let (mut store, _) = mounted(&mut flash);
    store.save(Key::item(1), b"gone").expect("room");
    let mut bytes = flash.bytes().to_vec();
    bytes[..16_384].fill(0x12);
    let mut flash = Flash::with(&bytes);
    assert_eq!(mounted(&mut flash).1, StoreCondition::Unreadable);
    assert_eq!(mounted(&mut flash).1, StoreCondition::Kept);
}

#[test]
fn flash_that_does_not_work_is_told() {
    let mut flash = Flash::blank();
    flash.cut_after(1, 1);
    assert_eq!(flash.erase(0, 16_384), Err(NorFlashErrorKind::Other));
    assert_eq!(Store::mount(&mut flash).map(|_| ()), Err(Error::Flash(NorFlashErrorKind::Other)));
}

fn last_of(bytes: &[u8], wanted: &[u8]) -> usize {
    bytes.windows(wanted.len()).rposition(|window| window == wanted).expect("it is there")
}

#[test]
fn an_item_that_is_damaged_is_told_once_and_the_value_before_it_counts() {
    let mut flash = Flash::blank();
    let (mut store, _) = mounted(&mut flash);
    for (item, value) in
        [(1, "an old value"), (2, "the only value"), (1, "a new value"), (3, "another value")]
    {
        store.save(Key::item(item), value.as_bytes()).expect("room");
    }
    let whole = flash.bytes().to_vec();
    let (new, only) = (last_of(&whole, b"a new value"), last_of(&whole, b"the only value"));
    // Of each item: the length, all zeros, its complement, the key, the data, the checksum.
    for (value, place, bytes) in [
        (new, -8, &[0x77][..]),
        (new, -8, &[0; 4]),
        (new, -6, &[0]),
        (new, -4, &[2]),
        (new, 3, b"x"),
        (new, 12, &[0x55]),
        (new, 12, &[0; 4]),
        (only, 3, &[0; 8]),
    ] {
        let mut damaged = whole.clone();
        damaged[value.strict_add_signed(place)..][..bytes.len()].copy_from_slice(bytes);
        let mut flash = Flash::with(&damaged);
        let (mut store, found) = mounted(&mut flash);
        assert_eq!(found, StoreCondition::Damaged, "{bytes:x?} at {place}");
        let mut of = |item| {
            let mut buffer = [0; VALUE_BYTES_MAX];
            value_of(&mut store, item, &mut buffer).map(<[u8]>::to_vec)
        };
        let (first, second) = if value == new {
            ("an old value", Some(b"the only value".to_vec()))
        } else {
            ("a new value", None)
        };
        assert_eq!((of(1), of(2)), (Some(first.into()), second), "{bytes:x?} at {place}");
        assert_eq!(of(3), Some(b"another value".to_vec()));
        let (mut store, found) = mounted(&mut flash);
        assert_eq!((found, store.mounts()), (StoreCondition::Kept, Ok(3)), "{bytes:x?} at {place}");
    }
}

fn value_of<'b>(store: &mut Store<&mut Flash>, item: u8, buffer: &'b mut [u8]) -> Option<&'b [u8]> {
    value(store, Key::item(item), buffer)
}

#[test]
fn damage_of_a_sectors_marks_loses_nothing() {
    let mut flash = Flash::blank();
    let (mut store, _) = mounted(&mut flash);
    store.save(Key::item(1), b"stays").expect("room");
    let whole = flash.bytes().to_vec();
    for (sector, found_first) in [(0, StoreCondition::Damaged), (16_384, StoreCondition::Kept)] {
        for at in 0..8 {
            let mut damaged = whole.clone();
            damaged[sector + at] ^= 0x40;
            let mut flash = Flash::with(&damaged);
            for found_now in [found_first, StoreCondition::Kept] {
                let (mut store, found) = mounted(&mut flash);
                assert_eq!(found, found_now, "byte {at} of the sector at {sector}");
                assert_eq!(value_of(&mut store, 1, &mut [0; 5]), Some(&b"stays"[..]));
            }
        }
    }
}

#[test]
fn flash_that_is_no_longer_erased_takes_no_item() {
    for at in [9_000, 16_000, 16_384 + 200, 32_000] {
        let mut flash = Flash::blank();
        mounted(&mut flash).0.save(Key::item(1), b"first").expect("room");
        let mut bytes = flash.bytes().to_vec();
        bytes[at..at + 3].fill(0x5A);
        let mut flash = Flash::with(&bytes);
        for number in 0..40 {
            let (mut store, _) = mounted(&mut flash);
            assert!(
                number == 0 || value_of(&mut store, 1, &mut [0; 300]) == Some(&[number; 300][..]),
                "{at}"
            );
            store.allow_erase(true);
            store.save(Key::item(1), &[number + 1; 300]).expect("room");
        }
    }
}

#[test]
fn whatever_is_damaged_no_value_goes_back_without_a_word() {
    type Small = SimFlash<2048>;
    let mut flash = Small::blank();
    let mut had = vec![Vec::new(); 4];
    for round in 0..8_u8 {
        let (mut store, _) = Store::mount(&mut flash).expect("it works");
        store.allow_erase(true);
        for item in 0..4_u8 {
            let value = vec![16 * round + item + 1; 20 + 9 * usize::from(item)];
            store.save(Key::item(item), &value).expect("room");
            had[usize::from(item)].push(value);
        }
    }
    let whole = flash.bytes().to_vec();
    let newer = |at: usize| u16::from_le_bytes([whole[at + 4], whole[at + 5]]);
    let sector = if newer(2048) > newer(0) { 2048..4096 } else { 0..2048 };
    let last = whole[sector].iter().rposition(|byte| *byte != 0xFF).expect("items");
    let mut told = 0;
    for at in (0..whole.len() - 8).step_by(4).filter(|at| !(*at..at + 8).contains(&(at / 2048 * 2048 + last)))
    {
        for fill in [0, 0x5A, 0xFF] {
            let mut bytes = whole.clone();
            bytes[at..at + 8].fill(fill);
            let mut flash = Small::with(&bytes);
            let (mut store, found) = Store::mount(&mut flash).expect("it works");
            let mut newest = true;
            for (item, had) in (0..).zip(&had) {
                let mut buffer = [0; VALUE_BYTES_MAX];
                let length = store.get(Key::item(item), &mut buffer).expect("readable");
                let now = length.map(|length| buffer[..length].to_vec());
                assert!(now.as_ref().is_none_or(|now| had.contains(now)), "{fill:x} at {at}: {now:x?}");
                newest &= now.as_ref() == had.last();
            }
            assert!(newest || found != StoreCondition::Kept, "{fill:x} at {at}: {found:?}");
            assert!(
                fill == 0xFF || found != StoreCondition::Unreadable,
                "{fill:x} at {at}: other items are whole"
            );
            told += u32::from(found == StoreCondition::Damaged);
            assert_eq!(
                Store::mount(&mut flash).map(|(_, found)| found),
                Ok(StoreCondition::Kept),
                "{fill:x} at {at}"
            );
        }
    }
    assert!(told > 100, "{told}");
}
