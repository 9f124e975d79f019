//! Power cuts at any word: each item reads as its old or its new value, and the store continues.

use std::collections::BTreeMap;

use embedded_storage::nor_flash::NorFlash;

use crate::sim::SimFlash;
use crate::{Error, Key, Store, StoreCondition};

struct Random(u64);

impl Random {
    fn below(&mut self, limit: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % limit
    }

    fn value(&mut self, length_max: u64) -> Vec<u8> {
        let length = self.below(length_max + 1);
        let byte = if self.below(3) == 0 { 0xFF } else { self.below(256) as u8 };
        (0..length).map(|at| if byte == 0xFF { byte } else { byte.wrapping_add(at as u8) }).collect()
    }
}

type Items = BTreeMap<Key, Vec<u8>>;

fn items<F: NorFlash<Error: Copy>>(store: &mut Store<F>) -> Items {
    let mut items = Items::new();
    store
        .for_each(|key, value| {
            items.insert(key, value.to_vec());
        })
        .expect("readable");
    items
}

fn cut_and_look<const SECTOR: usize>(cuts: u64, seed: u64, length_max: u64, steps_max: u64) -> u64 {
    let mut random = Random(seed);
    let mut flash = SimFlash::<SECTOR>::blank();
    let mut expected = Items::new();
    let mut erases = 0;
    for cut in 0..cuts {
        let before = flash.erases();
        flash.cut_after(1 + random.below(steps_max), cut);
        let mut writing = None;
        if let Ok((mut store, found)) = Store::mount(&mut flash) {
            assert!(cut == 0 || found == StoreCondition::Kept, "{found:?} before cut {cut}");
            loop {
                if random.below(20) == 0 {
                    store.allow_erase(random.below(2) == 0);
                }
                if random.below(200) == 0 && store.turn_ahead(SECTOR / 2).is_err() {
                    break;
                }
                let (key, value) = (Key::item(random.below(5) as u8), random.value(length_max));
                match store.save(key, &value) {
                    Ok(_) => {
                        expected.insert(key, value);
                    }
                    Err(Error::NotNow) => store.allow_erase(true),
                    Err(Error::Flash(_)) => {
                        writing = Some((key, value));
                        break;
                    }
                    Err(error) => panic!("{error:?} before cut {cut}"),
                }
            }
        }
        assert!(flash.is_dead());
        erases += flash.erases() - before;
        flash.revive();
        let (mut store, found) = Store::mount(&mut flash).expect("power stays");
        assert!(found == StoreCondition::Kept || expected.is_empty(), "{found:?} after cut {cut}");
        let now = items(&mut store);
        if let Some((key, value)) = writing
            && now.get(&key) == Some(&value)
        {
            expected.insert(key, value);
        }
        assert_eq!(now, expected, "after cut {cut}");
    }
    erases
}

#[test]
fn after_ten_thousand_cuts_each_item_was_old_or_new_every_time() {
    let erases = cut_and_look::<2048>(9_000, 1, 200, 400);
    assert!(erases > 1_000, "{erases} erases for the cuts to meet");
    // As on the board.
    cut_and_look::<16384>(1_000, 2, 512, 6_000);
}
