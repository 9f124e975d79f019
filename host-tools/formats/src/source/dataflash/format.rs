//! The form of messages, by FMT, UNIT, MULT and FMTU. Source: `LogStructure.h` of `ArduPilot`.

use std::sync::Arc;

use hums_dialect::Kind;

use crate::source::item::Table;

/// Two of head, one of type.
pub(super) const HEADER_BYTES: usize = 3;
/// Its layout is fixed.
pub(super) const FMT_TYPE: u8 = 128;
pub(super) const FMT_BYTES: u8 = 89;
/// FMT defines itself.
pub(super) const BEGINNING: &[u8] = &[0xA3, 0x95, FMT_TYPE, FMT_TYPE, FMT_BYTES];
/// The format string has 16 characters.
const FIELDS_MAX: usize = 16;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum FieldKind {
    Number(Kind),
    /// `M`: a flight mode, a number in a binary log and a name in a text log
    Mode,
    /// `g`
    Half,
    /// `c`, `C`, `e`, `E`
    Hundredths(Kind),
    /// `L`: 1e-7 degrees
    Degrees,
    /// `n`, `N`, `Z`: text, ended by a NUL if shorter
    Text(u8),
    /// `a`: 32 numbers of 16 bits
    Array,
}

/// Names in a binary FMT.
const COLUMNS_BYTES: usize = 64;
/// Numbers in an `a` field.
pub(super) const ARRAY_LENGTH: usize = 32;

impl FieldKind {
    fn of(character: u8) -> Option<Self> {
        Some(match character {
            b'b' => Self::Number(Kind::I8),
            b'B' => Self::Number(Kind::U8),
            b'M' => Self::Mode,
            b'h' => Self::Number(Kind::I16),
            b'H' => Self::Number(Kind::U16),
            b'i' => Self::Number(Kind::I32),
            b'I' => Self::Number(Kind::U32),
            b'q' => Self::Number(Kind::I64),
            b'Q' => Self::Number(Kind::U64),
            b'g' => Self::Half,
            b'f' => Self::Number(Kind::F32),
            b'd' => Self::Number(Kind::F64),
            b'c' => Self::Hundredths(Kind::I16),
            b'C' => Self::Hundredths(Kind::U16),
            b'e' => Self::Hundredths(Kind::I32),
            b'E' => Self::Hundredths(Kind::U32),
            b'L' => Self::Degrees,
            b'n' => Self::Text(4),
            b'N' => Self::Text(16),
            b'Z' => Self::Text(64),
            b'a' => Self::Array,
            _ => return None,
        })
    }

    pub(super) const fn size(self) -> usize {
        match self {
            Self::Number(kind) | Self::Hundredths(kind) => kind.size(),
            Self::Mode => 1,
            Self::Half => 2,
            Self::Degrees => 4,
            Self::Text(bytes) => bytes as usize,
            Self::Array => 2 * ARRAY_LENGTH,
        }
    }

    /// FMTU's multiplier is then already in it.
    const fn scales(self) -> bool {
        matches!(self, Self::Hundredths(_) | Self::Degrees)
    }

    /// Whole steps, not scaled by the format character.
    pub(super) const fn is_integer(self) -> bool {
        match self {
            Self::Number(kind) => !matches!(kind, Kind::F32 | Kind::F64),
            kind => matches!(kind, Self::Mode),
        }
    }
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Field {
    /// Its label.
    pub(super) name: String,
    pub(super) kind: FieldKind,
    pub(super) offset: usize,
}

#[derive(Clone, Debug)]
pub(super) struct Format {
    /// Third byte of a message.
    pub(super) kind: u8,
    /// Its name: `ATT`.
    pub(super) name: String,
    pub(super) length: u8,
    /// Its columns.
    pub(super) fields: Vec<Field>,
    pub(super) fields_length: Option<u8>,
    /// Unreadable parts, until reported.
    odd: Option<String>,
    is_known: bool,
    lacks_names: bool,
    pub(super) characters: usize,
    /// Column and kind.
    pub(super) time: Option<TimeField>,
    /// Its rows' table, once a row was made.
    pub(super) table: Option<Arc<Table>>,
    pub(super) role: Role,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    Fmt,
    Fmtu,
    Unit,
    Mult,
    /// Not a definition.
    Other,
}

impl Role {
    fn of(kind: u8, name: &str) -> Self {
        match name {
            _ if kind == FMT_TYPE => Self::Fmt,
            "FMTU" => Self::Fmtu,
            "UNIT" => Self::Unit,
            "MULT" => Self::Mult,
            _ => Self::Other,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum TimeField {
    /// Microseconds since power-on in this column: since 2015.
    Micros(u8),
    /// Milliseconds since power-on in this column: before.
    Millis(u8),
}

impl Format {
    /// FMT itself.
    fn of_formats() -> Self {
        let columns = "Type,Length,Name,Format,Columns";
        Self::new(FMT_TYPE, FMT_BYTES, "FMT", b"BBnNZ", columns)
    }

    /// A definition.
    pub(super) fn new(kind: u8, length: u8, name: &str, characters: &[u8], columns: &str) -> Self {
        let (mut fields, mut offset, mut unknown) = (Vec::new(), 0, None);
        let mut labels = columns.split(',').map(str::trim);
        for &character in characters.iter().take(FIELDS_MAX).take_while(|character| **character != 0) {
            let Some(kind) = FieldKind::of(character) else {
                unknown = Some(char::from(character));
                break;
            };
            let label = labels.next().unwrap_or_default();
            let fits = HEADER_BYTES + offset + kind.size() <= usize::from(length);
            if !label.is_empty() && (fits || length == 0) {
                fields.push(Field { name: label.to_owned(), kind, offset });
            }
            offset += kind.size();
        }
        let fields_length = u8::try_from(HEADER_BYTES + offset).ok();
        let fields_length = fields_length.filter(|fields| unknown.is_none() && *fields != length);
        let time = time_field(name, &fields);
        let role = Role::of(kind, name);
        let characters = characters.iter().take(FIELDS_MAX).take_while(|character| **character != 0).count();
        let named = columns.split(',').filter(|label| !label.trim().is_empty()).count();
        // FMT's own column cuts names off.
        let lacks_names = named < characters && columns.len() + 1 < COLUMNS_BYTES;
        let odd = odd(name, length, unknown, HEADER_BYTES + offset)
            .or_else(|| lacks_names.then(|| unnamed(name, named, characters)));
        let name = name.to_owned();
        Self {
            kind,
            name,
            length,
            fields,
            fields_length,
            odd,
            is_known: unknown.is_none(),
            lacks_names,
            characters,
            time,
            table: None,
            role,
        }
    }

    fn same(&self, other: &Self) -> bool {
        self.name == other.name && self.length == other.length && self.fields == other.fields
    }

    /// May contain commas.
    pub(super) fn ends_in_text(&self) -> bool {
        self.fields.last().is_none_or(|field| matches!(field.kind, FieldKind::Text(_)))
    }

    pub(super) fn field(&self, name: &str) -> Option<usize> {
        self.fields.iter().position(|field| field.name == name)
    }
}

/// Time field: before 2015 a GPS message's `TimeMS` is the time of week, and `T` the time since power-on.
fn time_field(name: &str, fields: &[Field]) -> Option<TimeField> {
    let at = |label: &str, kinds: &[FieldKind]| {
        let found = fields.iter().position(|field| field.name == label && kinds.contains(&field.kind))?;
        u8::try_from(found).ok()
    };
    let micros = [Kind::U64, Kind::I64].map(FieldKind::Number);
    let millis = [Kind::U32, Kind::I32].map(FieldKind::Number);
    if let Some(column) = at("TimeUS", &micros) {
        return Some(TimeField::Micros(column));
    }
    if name.starts_with("GPS") { at("T", &millis) } else { at("TimeMS", &millis) }.map(TimeField::Millis)
}

#[derive(Clone, Debug, Default)]
struct Units {
    units: Vec<u8>,
    multipliers: Vec<u8>,
}

/// So far.
pub(super) struct Formats {
    by_kind: Vec<Option<Box<Format>>>,
    /// Lengths with the header by type; 0 without a definition.
    pub(super) lengths: Lengths,
    units: Vec<Option<Units>>,
    unit_names: Vec<Option<String>>,
    multipliers: Vec<Option<f64>>,
    /// The oldest logs have only the GPS receiver's time.
    pub(super) has_boot_clock: bool,
    /// Type.
    newest: Option<u8>,
}

/// Lengths of the types, as a scanner needs them.
#[derive(Clone, Debug)]
pub(super) struct Lengths {
    /// From FMT; 0 without a usable definition.
    pub(super) told: [u8; 256],
    /// From the fields, if different; 0 otherwise.
    pub(super) fields: [u8; 256],
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Defined {
    /// New or changed.
    New,
    Known,
    Refused(String),
}

impl Formats {
    /// Only FMT is defined.
    pub(super) fn new() -> Self {
        let mut by_kind: Vec<Option<Box<Format>>> = Vec::new();
        by_kind.resize_with(256, || None);
        let mut lengths = Lengths { told: [0; 256], fields: [0; 256] };
        lengths.told[usize::from(FMT_TYPE)] = FMT_BYTES;
        by_kind[usize::from(FMT_TYPE)] = Some(Box::new(Format::of_formats()));
        Self {
            by_kind,
            lengths,
            units: vec![None; 256],
            unit_names: vec![None; 256],
            multipliers: vec![None; 256],
            has_boot_clock: false,
            newest: None,
        }
    }

    pub(super) fn get(&self, kind: u8) -> Option<&Format> {
        self.by_kind.get(usize::from(kind))?.as_deref()
    }

    /// The last definition.
    pub(super) fn newest(&self) -> Option<&Format> {
        self.get(self.newest?)
    }

    /// State for a second reading: units and the clock are kept, messages are not.
    pub(super) fn begun_again(self) -> Self {
        let Self { units, unit_names, multipliers, has_boot_clock, .. } = self;
        Self { units, unit_names, multipliers, has_boot_clock, ..Self::new() }
    }

    /// FMT's own definition is fixed.
    pub(super) fn define(&mut self, format: Format) -> Defined {
        let place = usize::from(format.kind);
        if format.kind == FMT_TYPE {
            let (told, name) = (format.length, &format.name);
            let known = told == FMT_BYTES && name == "FMT";
            return if known { Defined::Known } else { Defined::Refused(odd_fmt(name, told)) };
        }
        let Some(slot) = self.by_kind.get_mut(place) else { return Defined::Known };
        if slot.as_ref().is_some_and(|known| known.same(&format)) {
            return Defined::Known;
        }
        let follows = usize::from(format.length) > HEADER_BYTES;
        self.lengths.told[place] = if follows { format.length } else { format.fields_length.unwrap_or(0) };
        self.lengths.fields[place] = if follows { format.fields_length.unwrap_or(0) } else { 0 };
        self.has_boot_clock |= format.time.is_some() && !format.name.starts_with("GPS");
        self.newest = Some(format.kind);
        *slot = Some(Box::new(format));
        Defined::New
    }

    /// Does not matter for a text log's lines.
    pub(super) fn is_only_long(&self, kind: u8) -> bool {
        self.get(kind).is_some_and(|format| format.is_known && !format.lacks_names)
    }

    /// The fault of a definition, once.
    pub(super) fn take_odd(&mut self, kind: u8) -> Option<String> {
        self.by_kind.get_mut(usize::from(kind))?.as_deref_mut()?.odd.take()
    }

    pub(super) fn define_unit(&mut self, id: u8, name: &str) {
        if let Some(slot) = self.unit_names.get_mut(usize::from(id)) {
            *slot = Some(name.to_owned());
        }
    }

    pub(super) fn define_multiplier(&mut self, id: u8, factor: f64) {
        if let Some(slot) = self.multipliers.get_mut(usize::from(id)) {
            *slot = Some(factor);
        }
    }

    /// A character a column.
    pub(super) fn define_units(&mut self, kind: u8, units: &str, multipliers: &str) {
        if let Some(slot) = self.units.get_mut(usize::from(kind)) {
            *slot = Some(Units { units: units.into(), multipliers: multipliers.into() });
        }
    }

    /// Empty if unknown.
    fn unit(&self, kind: u8, column: usize, field: FieldKind) -> String {
        let known = || {
            let units = self.units.get(usize::from(kind))?.as_ref()?;
            let id = *units.units.get(column)?;
            let name = self.unit_names.get(usize::from(id))?.as_deref()?;
            let multiplier = units.multipliers.get(column).copied();
            let factor = multiplier.and_then(|id| *self.multipliers.get(usize::from(id))?);
            Some(unit_of(name, if field.scales() { None } else { factor }))
        };
        known().unwrap_or_default()
    }

    pub(super) fn units(&self, kind: u8) -> Vec<String> {
        let fields = self.get(kind).map_or(&[][..], |format| &format.fields);
        fields.iter().enumerate().map(|(column, field)| self.unit(kind, column, field.kind)).collect()
    }

    pub(super) fn set_table(&mut self, kind: u8, table: &Arc<Table>) {
        if let Some(format) = self.by_kind.get_mut(usize::from(kind)).and_then(Option::as_deref_mut) {
            format.table = Some(Arc::clone(table));
        }
    }
}

fn odd_fmt(name: &str, length: u8) -> String {
    format!("a definition of FMT itself, with the name {name:?} and {length} bytes, which is not followed")
}

fn unnamed(name: &str, named: usize, characters: usize) -> String {
    format!("FMT names {named} of the {characters} columns of {name}: those without a name are not read")
}

fn odd(name: &str, length: u8, unknown: Option<char>, fields: usize) -> Option<String> {
    if let Some(character) = unknown {
        return Some(format!(
            "{name} has the format character {character:?}, which is not known: its columns from there on are not read"
        ));
    }
    let length = usize::from(length);
    let so = match length {
        _ if fields == length => return None,
        _ if length <= HEADER_BYTES => "which its messages are taken to have",
        _ if fields > length => "those that do not fit are not read",
        _ => "what is behind its columns is not read",
    };
    Some(format!("FMT says that {name} has {length} bytes, and its columns make {fields}: {so}"))
}

/// With the multiplier as a prefix. `!` and `/` make `mAh` or `Ah` of `A.s`.
fn unit_of(name: &str, factor: Option<f64>) -> String {
    if matches!(name, "" | "UNKNOWN" | "instance") {
        return String::new();
    }
    let Some(factor) = factor.filter(|factor| factor.is_finite() && *factor != 0.0) else {
        return name.to_owned();
    };
    // Single precision reads 1e-6 as 0.0000009999999974752427.
    let is = |other: f64| (factor / other - 1.0).abs() < 1e-6;
    let prefix = [(1.0, ""), (0.1, "d"), (0.01, "c"), (1e-3, "m"), (1e-6, "u"), (1e-9, "n")];
    if let Some((_, prefix)) = prefix.iter().find(|(value, _)| is(*value)) {
        return format!("{prefix}{name}");
    }
    match name {
        "A.s" if is(3.6) => "mAh".to_owned(),
        "A.s" if is(3_600.0) => "Ah".to_owned(),
        _ => format!("{factor} {name}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_have_their_multipliers_as_prefixes() {
        assert_eq!(unit_of("s", Some(1e-6)), "us");
        assert_eq!(unit_of("s", Some(f64::from(1e-6_f32))), "us");
        assert_eq!(unit_of("A.s", Some(3.6)), "mAh");
        assert_eq!(unit_of("m", Some(100.0)), "100 m");
        assert_eq!(unit_of("deg", None), "deg");
        assert_eq!(unit_of("instance", Some(1.0)), "");
    }

    #[test]
    fn a_definition_that_repeats_changes_nothing_and_one_that_differs_replaces() {
        let mut formats = Formats::new();
        let att = |columns| Format::new(130, 13, "ATT", b"Qc", columns);
        assert_eq!(formats.define(att("TimeUS,Roll")), Defined::New);
        assert_eq!(formats.define(att("TimeUS,Roll")), Defined::Known);
        assert_eq!(formats.define(att("TimeUS,Pitch")), Defined::New);
        assert_eq!(formats.get(130).and_then(|format| format.field("Pitch")), Some(1));
    }

    #[test]
    fn a_length_that_the_columns_do_not_make_is_odd_and_both_are_kept() {
        let mut formats = Formats::new();
        formats.define(Format::new(130, 12, "ATT", b"Qc", "TimeUS,Roll"));
        let odd = formats.take_odd(130).expect("too short");
        assert!(odd.contains("12 bytes") && odd.contains("13"), "{odd}");
        assert_eq!((formats.lengths.told[130], formats.lengths.fields[130]), (12, 13));
        assert_eq!(formats.take_odd(130), None, "once");
        formats.define(Format::new(131, 0, "IMU", b"Qf", "TimeUS,GyrX"));
        assert_eq!((formats.lengths.told[131], formats.lengths.fields[131]), (15, 0));
    }

    #[test]
    fn nobody_redefines_what_defines() {
        let mut formats = Formats::new();
        let odd = formats.define(Format::new(FMT_TYPE, 12, "FMT", b"Q", "TimeUS"));
        assert!(matches!(odd, Defined::Refused(_)));
        assert_eq!(formats.lengths.told[usize::from(FMT_TYPE)], FMT_BYTES);
    }

    #[test]
    fn gps_time_of_the_week_is_not_the_time_since_power_on() {
        let gps = Format::new(130, 0, "GPS", b"BIHI", "Status,TimeMS,Week,T");
        assert_eq!(gps.time, Some(TimeField::Millis(3)));
        let without = Format::new(130, 0, "GPS", b"BIH", "Status,TimeMS,Week");
        assert_eq!(without.time, None);
        let att = Format::new(130, 0, "ATT", b"Ic", "TimeMS,Roll");
        assert_eq!(att.time, Some(TimeField::Millis(0)));
    }
}
