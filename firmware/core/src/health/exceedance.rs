//! Exceedances: crossings of limits, their peak and duration, for each check and instance, in this session and over
//! the airframe's life.
//!
//! Bounded: [`EXCEEDANCES_MAX`] checks and instances. One more is left out, unless it is critical and another never
//! was: it takes that one's place.

use super::check::{Check, Side};
use super::finding::{Finding, Level};
use super::tables::checks;
use crate::bytes::{Fields, Unreadable, fields, fnv1a};
use crate::time::BootMs;

/// Checks and instances that are kept.
pub const EXCEEDANCES_MAX: usize = 24;

state! {
    /// Crossings of one check's limits.
    pub struct Crossings {
        /// How often a warning began.
        pub warnings: u16,
        /// How often it became critical.
        pub criticals: u16,
        /// How long it was a warning, tenths of a second.
        pub warning_tenths: u32,
        /// How long it was critical, tenths of a second.
        pub critical_tenths: u32,
        /// The worst value, in the check's unit; NaN before there was one.
        pub peak: f32 = f32::NAN,
    }
}

impl Crossings {
    /// Whether anything was exceeded at all.
    pub const fn happened(&self) -> bool {
        self.warnings > 0 || self.criticals > 0
    }

    fn join(self, other: Self, side: Side) -> Self {
        Self {
            warnings: self.warnings.saturating_add(other.warnings),
            criticals: self.criticals.saturating_add(other.criticals),
            warning_tenths: self.warning_tenths.saturating_add(other.warning_tenths),
            critical_tenths: self.critical_tenths.saturating_add(other.critical_tenths),
            peak: worse(self.peak, other.peak, side),
        }
    }

    fn code(&mut self, name: &mut u32, instance: &mut u8, fields: &mut Fields<'_>) -> Result<(), Unreadable> {
        let Self { warnings, criticals, warning_tenths, critical_tenths, peak } = self;
        fields!(fields: name, instance, warnings, criticals, warning_tenths, critical_tenths, peak);
        Ok(())
    }

    fn extend(&mut self, level: Level, tenths: u32) {
        match level {
            Level::Warning => self.warning_tenths = self.warning_tenths.saturating_add(tenths),
            Level::Critical => self.critical_tenths = self.critical_tenths.saturating_add(tenths),
            _ => {}
        }
    }
}

/// The worse of two values; NaN is none.
const fn worse(known: f32, value: f32, side: Side) -> f32 {
    match side {
        Side::Above => known.max(value),
        Side::Below => known.min(value),
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Entry {
    check: u16,
    instance: u8,
    /// [`Level::Ok`] while nothing is exceeded.
    level: Level,
    since: BootMs,
    session: Crossings,
    before: Crossings,
}

impl Entry {
    fn of(check: u16, instance: u8, since: BootMs) -> Self {
        let (session, before) = (Crossings::default(), Crossings::default());
        Self { check, instance, level: Level::Ok, since, session, before }
    }

    fn extend(&mut self, now: BootMs) {
        self.session.extend(self.level, (now.since(self.since).as_millis() / 100) as u32);
        self.since = now;
    }

    fn now(mut self, now: BootMs) -> Option<Exceedance> {
        self.extend(now);
        let check = checks().nth(self.check.into())?;
        let lifetime = self.before.join(self.session, check.limits.side);
        Some(Exceedance { check, instance: self.instance, session: self.session, lifetime })
    }
}

state! {
    /// All exceedances.
    pub struct Exceedances {
        entries: [Option<Entry>; EXCEEDANCES_MAX] = [None; EXCEEDANCES_MAX],
    }
}

/// One check's exceedances.
#[derive(Clone, Copy, Debug)]
pub struct Exceedance {
    /// Which check.
    pub check: &'static Check,
    /// Which one, where there are several.
    pub instance: u8,
    /// Of this session.
    pub session: Crossings,
    /// Of the airframe's life, this session included.
    pub lifetime: Crossings,
}

const VERSION: u8 = 1;

impl Exceedances {
    /// The longest stored form: version, then the entries. Each has the FNV-1a hash of the check's name (u32),
    /// instance, warnings and criticals (u16), tenths of a second of both (u32), peak (f32).
    pub const BYTES: usize = 1 + EXCEEDANCES_MAX * (4 + 1 + 2 + 2 + 4 + 4 + 4);

    pub(crate) fn change(&mut self, check: u16, side: Side, finding: &Finding) {
        let Some(entry) = self.entry(check, finding) else { return };
        entry.extend(finding.at);
        match finding.level {
            Level::Warning if finding.previous != Level::Critical => {
                entry.session.warnings = entry.session.warnings.saturating_add(1);
            }
            Level::Critical => entry.session.criticals = entry.session.criticals.saturating_add(1),
            _ => {}
        }
        if finding.level.alarm() > 0 {
            entry.session.peak = worse(entry.session.peak, finding.value, side);
        }
        entry.level = finding.level;
    }

    pub(crate) fn note(&mut self, check: u16, instance: u8, side: Side, value: f32) {
        if let Some(entry) = self.place(check, instance).and_then(|place| self.entries[place].as_mut()) {
            entry.session.peak = worse(entry.session.peak, value, side);
        }
    }

    fn place(&self, check: u16, instance: u8) -> Option<usize> {
        let is_same = |entry: &Entry| (entry.check, entry.instance) == (check, instance);
        self.entries.iter().position(|entry| entry.as_ref().is_some_and(is_same))
    }

    fn entry(&mut self, check: u16, finding: &Finding) -> Option<&mut Entry> {
        let known = self.place(check, finding.instance);
        if known.is_some() || finding.level.alarm() == 0 {
            return self.entries.get_mut(known?)?.as_mut();
        }
        let never_critical = |entry: &Entry| entry.session.criticals == 0 && entry.before.criticals == 0;
        let is_lesser = |entry: &Entry| finding.level == Level::Critical && never_critical(entry);
        let free = self.entries.iter().position(Option::is_none);
        let place =
            free.or_else(|| self.entries.iter().position(|entry| entry.as_ref().is_some_and(is_lesser)));
        Some(self.entries.get_mut(place?)?.insert(Entry::of(check, finding.instance, finding.at)))
    }

    /// Every exceedance, counted up to now.
    pub fn iter(&self, now: BootMs) -> impl Iterator<Item = Exceedance> {
        self.entries.iter().flatten().filter_map(move |entry| entry.now(now))
    }

    /// Every exceedance that began, ended or lasted at a time or after it, counted up to now.
    pub fn changed(&self, now: BootMs, since: BootMs) -> impl Iterator<Item = Exceedance> {
        let changed = move |entry: &&Entry| entry.level.alarm() > 0 || !since.is_after(entry.since);
        self.entries.iter().flatten().filter(changed).filter_map(move |entry| entry.now(now))
    }

    pub(crate) fn end(&mut self, now: BootMs) {
        for entry in self.entries.iter_mut().flatten() {
            entry.extend(now);
            entry.level = Level::Ok;
        }
    }

    pub(crate) fn lasting(&self) -> bool {
        self.entries.iter().flatten().any(|entry| entry.level.alarm() > 0)
    }

    /// Forgets the exceedances of the life: they are another airframe's.
    pub(crate) fn forget_life(&mut self) {
        for place in &mut self.entries {
            match place {
                Some(entry) if entry.session.happened() => entry.before = Crossings::default(),
                _ => *place = None,
            }
        }
    }

    /// Writes the stored form of the entries in use; returns its length.
    pub fn encode(&self, now: BootMs, out: &mut [u8]) -> usize {
        let mut fields = Fields::write(out, VERSION);
        for Exceedance { check, mut instance, mut lifetime, .. } in self.iter(now) {
            // Writing has no errors.
            let _ = lifetime.code(&mut fnv1a(check.name), &mut instance, &mut fields);
        }
        fields.at
    }

    /// Reads the stored form, of this version or a later one. Checks that no longer exist are left out.
    ///
    /// # Errors
    /// [`Unreadable`] if it ends within an entry, or has no version.
    pub fn decode(stored: &[u8]) -> Result<Self, Unreadable> {
        let mut fields = Fields::read(stored, VERSION)?;
        let mut exceedances = Self::default();
        for place in &mut exceedances.entries {
            if fields.is_read() {
                break;
            }
            let (mut name, mut instance, mut before) = (0, 0, Crossings::default());
            before.code(&mut name, &mut instance, &mut fields)?;
            let check = checks().position(|check| fnv1a(check.name) == name && instance < check.instances);
            *place = check.map(|check| Entry { before, ..Entry::of(check as u16, instance, BootMs::ZERO) });
        }
        Ok(exceedances)
    }
}

#[cfg(test)]
mod tests;
