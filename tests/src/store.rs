//! A store's file, read with the firmware's own crates: no other reader exists.

use std::fs;
use std::path::Path;

use hums_core::lifetime::{Item as _, ItemKey, Lifetime, Session};
use hums_store::sim::SimFlash;
use hums_store::{Store, StoreCondition, param};

/// Items that outlived power.
#[derive(Debug, Default)]
pub struct Stored {
    /// Life counters with the last session.
    pub lifetime: Option<Lifetime>,
    /// Set parameters.
    pub params: Vec<(String, f32)>,
}

impl Stored {
    /// Must be a store in order.
    pub fn read(path: &Path) -> Self {
        let flash = SimFlash::<16_384>::with(&fs::read(path).unwrap());
        let (mut store, found) = Store::mount(flash).unwrap_or_else(|why| panic!("{why:?}"));
        assert_eq!(found, StoreCondition::Kept, "{}", path.display());
        let (mut stored, mut session) = (Self::default(), None);
        let read = store.for_each(|key, value| {
            if key.is_param() {
                let (name, value) = param(value).unwrap();
                stored.params.retain(|(other, _)| other != name);
                stored.params.push((name.to_owned(), value));
            } else if key.number() == Some(ItemKey::Lifetime.number()) {
                stored.lifetime = Some(Lifetime::decode(value).unwrap());
            } else if key.number() == Some(ItemKey::Session.number()) {
                session = Some(Session::decode(value).unwrap());
            }
        });
        assert!(read.is_ok());
        if let (Some(lifetime), Some(session)) = (&mut stored.lifetime, session) {
            lifetime.add(&session);
        }
        stored
    }

    /// The counters.
    pub fn lifetime(&self) -> &Lifetime {
        self.lifetime.as_ref().unwrap()
    }
}
