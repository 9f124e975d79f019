//! Cells in series of a battery.
//!
//! A wrong count is worse than none: it hides an empty pack, or calls a good one empty. So without a certain count
//! nothing follows from cell voltage, and the pilot gets a text that names the setting.
//!
//! In this order:
//!
//! 1. The setting `BAT_CELLS`, for every pack. If the voltage does not fit it (another second pack), the count is
//!    unknown, unless the cells are reported one by one.
//! 2. The cells that the battery reports one by one.
//! 3. The autopilot's parameters, as far as the measured voltage does not contradict them.
//! 4. The highest voltage since power-on, of a pack at rest, if only one count fits it: 3.5 to 4.4 V a cell.
//! 5. The count of earlier flights, if it is one of several that fit and gives 3.7 V a cell at rest.
//!
//! Packs are swapped, so a stored count must fit the voltage. A full pack with one cell less is recognised (a 5S
//! after a 6S has 3.5 V a cell of six). A half empty pack with one cell more is not (a 7S of 25.9 V after a 6S).
//!
//! A pack is a new one when its voltage falls by a third while the vehicle is disarmed.

use crate::vehicle::BATTERIES_MAX;

/// Maximum cells of one battery.
pub const COUNT_MAX: usize = 24;
/// Batteries for which autopilots have parameters.
const SET_MAX: usize = 2;
/// The highest voltage of a cell: a full one has 4.2 V, a high-voltage one 4.35 V.
const CELL_HIGHEST_V: f32 = 4.4;
/// The least voltage of a cell at rest before a flight: lithium polymer is nearly empty there, lithium ion below
/// half.
const CELL_RESTING_V: f32 = 3.5;
/// The least voltage of a cell at rest by which a count of earlier flights is chosen among several.
const CELL_CONFIRMED_V: f32 = 3.7;
/// The least voltage of a cell, nearly empty, at rest and under load.
const CELL_EMPTY_V: f32 = 3.0;
const CELL_LOADED_V: f32 = 2.8;
/// A pack whose voltage falls below this part of its highest while disarmed is a new one.
const ANOTHER: f32 = 0.7;
/// Flag of a stored count that the last flight did not confirm.
pub(crate) const DOUBTED: u8 = 0x80;
/// Below this no battery is connected.
const PLUGGED_V: f32 = 2.5;
/// `ArduPilot`'s default of `BATT_LOW_VOLT`.
const LOW_AS_DELIVERED_V: f32 = 10.5;

/// The meaning of an autopilot's parameter for a battery.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Setting {
    /// The number of cells.
    Count = 0,
    /// The pack's voltage when it is full.
    Full = 1,
    /// The pack's voltage when it is empty.
    Empty = 2,
    /// The pack's voltage when it is low.
    Low = 3,
    /// The pack's voltage when it is critical.
    Critical = 4,
    /// Not about cells: its capacity, mAh.
    Capacity = 5,
}

const SETTINGS: usize = Setting::Capacity as usize + 1;

/// Range of a cell's voltage at these settings, V.
const CELL_V: [(f32, f32); SETTINGS - 1] = [(0.0, 0.0), (4.08, 4.4), (2.7, 3.75), (3.25, 3.8), (2.9, 3.7)];

/// An autopilot's parameter for a battery: whether it is PX4's, its name, the battery, its meaning.
pub type CellParameter = (bool, &'static str, u8, Setting);

/// The known parameters.
pub const KNOWN: [CellParameter; 17] = [
    (true, "BAT1_N_CELLS", 0, Setting::Count),
    (true, "BAT2_N_CELLS", 1, Setting::Count),
    (true, "BAT_N_CELLS", 0, Setting::Count),
    (false, "MOT_BAT_VOLT_MAX", 0, Setting::Full),
    (false, "MOT_BAT_VOLT_MIN", 0, Setting::Empty),
    (false, "Q_M_BAT_VOLT_MAX", 0, Setting::Full),
    (false, "Q_M_BAT_VOLT_MIN", 0, Setting::Empty),
    (false, "FWD_BAT_VOLT_MAX", 0, Setting::Full),
    (false, "FWD_BAT_VOLT_MIN", 0, Setting::Empty),
    (false, "BATT_LOW_VOLT", 0, Setting::Low),
    (false, "BATT_CRT_VOLT", 0, Setting::Critical),
    (false, "BATT2_LOW_VOLT", 1, Setting::Low),
    (false, "BATT2_CRT_VOLT", 1, Setting::Critical),
    (true, "BAT1_CAPACITY", 0, Setting::Capacity),
    (true, "BAT2_CAPACITY", 1, Setting::Capacity),
    (false, "BATT_CAPACITY", 0, Setting::Capacity),
    (false, "BATT2_CAPACITY", 1, Setting::Capacity),
];

/// The place in [`KNOWN`] of a parameter's name.
pub fn known(name: &str) -> Option<u8> {
    KNOWN.iter().position(|(_, known, ..)| *known == name).map(|place| place as u8)
}

state! {
    struct Pack {
        highest_v: f32,
        /// The autopilot's id of the battery, by which parameters go. The order of first messages may differ.
        id: u8,
        rested: bool,
        /// 0: none.
        before: u8,
        doubted: bool,
        count: u8,
    }

    /// The cells of all batteries.
    pub struct Cells {
        packs: [Pack; BATTERIES_MAX] = [Pack::default(); BATTERIES_MAX],
        /// By the battery's id and [`Setting`]; 0: unknown, or not set.
        settings: [[f32; SETTINGS]; SET_MAX],
    }
}

type Counts = u32;

fn counts(volts: f32, from_v: f32, to_v: f32) -> Counts {
    let fits = |count: &usize| (from_v..=to_v).contains(&(volts / *count as f32));
    (1..=COUNT_MAX).filter(fits).fold(0, |counts, count| counts | 1 << count)
}

impl Cells {
    pub(crate) fn take_voltage(&mut self, battery: usize, id: u8, pack_v: f32, rests: bool, armed: bool) {
        let Some(pack) = self.packs.get_mut(battery).filter(|_| pack_v.is_finite() && pack_v > PLUGGED_V)
        else {
            return;
        };
        if !armed && pack_v < ANOTHER * pack.highest_v {
            *pack = Pack { highest_v: 0.0, rested: false, count: 0, ..*pack };
        }
        let rested = pack.rested || rests;
        if pack_v > pack.highest_v || rested != pack.rested || id != pack.id {
            (pack.highest_v, pack.rested, pack.id) = (pack.highest_v.max(pack_v), rested, id);
            self.count(battery);
        }
    }

    /// The value of a parameter of [`KNOWN`].
    pub(crate) fn take_setting(&mut self, place: u8, value: f32) {
        let Some((_, _, battery, setting)) = KNOWN.get(usize::from(place)) else { return };
        let Some(of) = self.settings.get_mut(usize::from(*battery)) else { return };
        let as_delivered = *setting == Setting::Low && (value - LOW_AS_DELIVERED_V).abs() < 0.01;
        let is_said = value.is_finite() && value > 0.0 && !as_delivered;
        of[*setting as usize] = if is_said { value } else { 0.0 };
        (0..BATTERIES_MAX).for_each(|place| self.count(place));
    }

    /// The count of earlier flights, with [`DOUBTED`] if the last one did not confirm it.
    pub(crate) fn remember(&mut self, battery: usize, count: u8) {
        if let Some(pack) = self.packs.get_mut(battery) {
            let known = count & !DOUBTED;
            pack.before = if usize::from(known) <= COUNT_MAX { known } else { 0 };
            pack.doubted = count != known;
            self.count(battery);
        }
    }

    /// Whether the autopilot compensates its motors for the voltage of the first battery (`MOT_BAT_VOLT_MAX`).
    pub(crate) fn is_compensated(&self) -> bool {
        self.settings.first().is_some_and(|settings| settings[Setting::Full as usize] > 0.0)
    }

    fn by_settings(&self, id: u8, possible: Counts) -> (Counts, bool) {
        let Some(settings) = self.settings.get(usize::from(id)) else { return (possible, false) };
        let (mut left, mut said) = (possible, false);
        for ((value, (from_v, to_v)), setting) in settings.iter().zip(CELL_V).zip(0..) {
            let fitting = match setting {
                _ if *value == 0.0 => continue,
                0 if *value <= COUNT_MAX as f32 => 1 << *value as u32,
                0 => 0,
                _ => counts(*value, from_v, to_v),
            };
            if left & fitting != 0 {
                (left, said) = (left & fitting, true);
            }
        }
        (left, said)
    }

    fn count(&mut self, battery: usize) {
        let Some(Pack { highest_v, id, rested, before, doubted, .. }) = self.packs.get(battery).copied()
        else {
            return;
        };
        let lowest_v = if rested { CELL_EMPTY_V } else { CELL_LOADED_V };
        let (by_settings, said) = self.by_settings(id, counts(highest_v, lowest_v, CELL_HIGHEST_V));
        let resting = counts(highest_v, CELL_RESTING_V, CELL_HIGHEST_V);
        // A voltage in flight alone says too little: a full pack's sags like an empty one's.
        let left = match by_settings & resting {
            both if rested && both != 0 => both,
            _ if said || !rested => by_settings,
            _ => resting,
        };
        let is_sure = left.is_power_of_two() && (said || rested);
        // In the air a cell may have any voltage, so only an earlier count is believed.
        let is_likely = if rested { highest_v >= f32::from(before) * CELL_CONFIRMED_V } else { !doubted };
        let confirmed = before > 0 && left >> before & 1 == 1 && is_likely;
        if let Some(pack) = self.packs.get_mut(battery) {
            pack.count = match (is_sure, confirmed) {
                (true, _) => left.trailing_zeros() as u8,
                (false, true) => before,
                (false, false) => 0,
            };
        }
    }

    pub(crate) fn fits(&self, battery: usize, count: u8) -> bool {
        self.packs.get(battery).is_some_and(|pack| {
            let lowest_v = if pack.rested { CELL_EMPTY_V } else { CELL_LOADED_V };
            (lowest_v..=CELL_HIGHEST_V).contains(&(pack.highest_v / f32::from(count.max(1))))
        })
    }

    /// The count; 0 if unknown.
    pub(crate) fn of(&self, battery: usize) -> u8 {
        self.packs.get(battery).map_or(0, |pack| pack.count)
    }

    /// Capacity of all batteries together, by the autopilot's parameters, Ah; 0 unless each is known.
    pub(crate) fn capacity_ah(&self) -> f32 {
        let heard = self.packs.iter().filter(|pack| pack.highest_v > 0.0);
        let set_mah =
            |pack: &Pack| Some(self.settings.get(usize::from(pack.id))?[Setting::Capacity as usize]);
        let each_ah = heard.map(|pack| set_mah(pack).filter(|mah| *mah > 0.0).map(|mah| mah / 1_000.0));
        each_ah.sum::<Option<f32>>().unwrap_or(0.0)
    }

    pub(crate) fn has_voltage(&self, battery: usize) -> bool {
        self.packs.get(battery).is_some_and(|pack| pack.highest_v > 0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The counts of the batteries after a script: `rest` and `fly` with the voltage of a pack, `rest1`
    /// of the second one, `before` with a stored count, or a parameter with its value.
    fn counts(script: &str) -> [u8; 2] {
        let mut cells = Cells::default();
        for step in script.split(", ").filter(|step| !step.is_empty()) {
            let (what, value) = step.split_once(' ').expect(step);
            let number: f32 = value.parse().expect(step);
            match what {
                "rest" => cells.take_voltage(0, 0, number, true, false),
                "rest1" => cells.take_voltage(1, 1, number, true, false),
                "fly" => cells.take_voltage(0, 0, number, false, true),
                "before" => cells.remember(0, number as u8),
                name => cells.take_setting(known(name).expect(name), number),
            }
        }
        [cells.of(0), cells.of(1)]
    }

    #[test]
    fn a_count_is_known_if_voltage_parameters_and_earlier_flights_leave_one() {
        for (what, script, expected) in [
            ("a full pack of one cell", "rest 4.2", 1),
            ("half full", "rest 3.8", 1),
            ("two", "rest 8.4", 2),
            ("three", "rest 12.6", 3),
            ("three, half full", "rest 11.4", 3),
            ("four", "rest 16.8", 4),
            ("four, half full", "rest 15.2", 4),
            ("four of high voltage", "rest 17.4", 4),
            ("it may be of several", "rest 25.2", 0),
            ("it may be of several", "rest 30.4", 0),
            ("it may be of several", "rest 50.4", 0),
            ("it may be of several", "rest 58.8", 0),
            ("a 4S in place of a 6S", "rest 16.8, MOT_BAT_VOLT_MAX 25.2", 4),
            ("as delivered it says nothing", "rest 25.2, BATT_LOW_VOLT 10.5", 0),
            ("a stored count confirms", "rest 25.2, before 6", 6),
            ("a 4S after a 6S is no dead 6S", "rest 16.8, before 6", 4),
            ("it does not fit", "rest 30.4, before 6", 0),
            // A full 5S after a 6S is not taken for an empty 6S. A 6S at 3.7 V is.
            ("a full 5S", "rest 21.1, before 6", 0),
            ("a full 5S of high voltage", "rest 21.7, before 6", 0),
            ("a 6S at 3.7 V", "rest 22.3, before 6", 6),
            ("of another count", "rest 25.2, before 7", 0),
            ("of another count", "rest 50.4, before 14", 0),
            // 0x80 is a doubt: the last flight did not confirm it.
            ("in the air", "before 6, fly 20.4", 6),
            ("in the air, doubted", "before 134, fly 20.4", 0),
            ("in the air, nothing and doubted", "before 128, fly 20.4", 0),
            ("in the air, garbage", "before 255, fly 20.4", 0),
            ("rested, doubted", "rest 25.2, before 134", 6),
            ("rested, nothing and doubted", "rest 25.2, before 128", 0),
            ("rested, garbage", "rest 25.2, before 255", 0),
            (
                "swapped while the autopilot is powered",
                "rest 25.2, MOT_BAT_VOLT_MAX 25.2, rest 0.3, rest 16.8",
                4,
            ),
            ("in flight the same is an empty pack", "rest 16.8, fly 11.0", 4),
            ("5 full or 6 half empty", "fly 20.4", 0),
            ("its last flight says which", "fly 20.4, before 6", 6),
            ("its parameter says which", "fly 20.4, before 6, before 0, BAT1_N_CELLS 6", 6),
        ] {
            assert_eq!(counts(script)[0], expected, "{what}: {script}");
        }
        assert_eq!(counts("rest 25.2, rest1 12.6, BAT2_N_CELLS 3, BAT1_N_CELLS 6"), [6, 3]);
    }

    #[test]
    fn the_voltage_alone_never_gives_a_wrong_count_from_3_5_v_to_4_4_v_a_cell() {
        for count in 1..=COUNT_MAX {
            for cell_cv in 351..440 {
                let [known, _] = counts(&format!("rest {}", count as f32 * cell_cv as f32 / 100.0));
                assert!([0, count as u8].contains(&known), "{count} cells at {cell_cv}: {known}");
            }
        }
    }

    #[test]
    fn with_the_autopilots_parameters_every_pack_of_every_chemistry_is_known_full_and_half_full() {
        // Full, half full; full, empty, low and critical as set: lithium polymer, lithium ion, high voltage.
        let chemistries = [
            ([4.2, 3.8], [4.2, 3.3, 3.6, 3.4]),
            ([4.2, 3.6], [4.2, 3.0, 3.3, 3.1]),
            ([4.35, 3.85], [4.35, 3.4, 3.6, 3.5]),
        ];
        for count in 1..=14 {
            let n = count as f32;
            for (levels, [full, empty, low, critical]) in chemistries {
                for level in levels {
                    let mut script = format!("rest {}", n * level);
                    assert_eq!(counts(&format!("{script}, BAT1_N_CELLS {n}"))[0], count as u8, "{script}");
                    for (name, value) in [
                        ("BATT_LOW_VOLT", low),
                        ("BATT_CRT_VOLT", critical),
                        ("MOT_BAT_VOLT_MAX", full),
                        ("MOT_BAT_VOLT_MIN", empty),
                    ] {
                        script = format!("{script}, {name} {}", n * value);
                        assert!([0, count as u8].contains(&counts(&script)[0]), "{script}");
                    }
                    assert_eq!(counts(&script)[0], count as u8, "{script}");
                }
            }
        }
    }

    #[test]
    fn parameters_that_are_not_set_say_nothing() {
        let mut none = Cells::default();
        none.take_voltage(0, 0, 15.2, true, false);
        for place in 0..KNOWN.len() as u8 {
            none.take_setting(place, 0.0);
            none.take_setting(place, f32::NAN);
        }
        assert_eq!((none.of(0), none.of(2), none.of(9)), (4, 0, 0));
    }

    #[test]
    fn a_setting_fits_a_pack_by_its_highest_voltage() {
        let mut cells = Cells::default();
        cells.take_voltage(0, 0, 12.6, true, false);
        let fitting: Vec<u8> = (0..=24).filter(|count| cells.fits(0, *count)).collect();
        assert_eq!(fitting, [3, 4], "and not 6");
        assert!(!cells.fits(1, 6) && !cells.fits(9, 6), "nothing was heard of it");
    }

    #[test]
    fn the_capacity_is_known_where_it_is_told_of_each_battery() {
        let set = |cells: &mut Cells, name: &str, mah| cells.take_setting(known(name).unwrap(), mah);
        let mut cells = Cells::default();
        cells.take_voltage(0, 0, 16.8, true, false);
        assert!(cells.capacity_ah().abs() < f32::EPSILON);
        set(&mut cells, "BATT_CAPACITY", 5_200.0);
        set(&mut cells, "BATT2_CAPACITY", 3_300.0);
        assert!((cells.capacity_ah() - 5.2).abs() < 1e-4, "no second one is there");
        cells.take_voltage(1, 1, 16.8, true, false);
        assert!((cells.capacity_ah() - 8.5).abs() < 1e-4);
        // PX4's -1: not known.
        set(&mut cells, "BAT2_CAPACITY", -1.0);
        assert!(cells.capacity_ah().abs() < f32::EPSILON);
        assert_eq!(cells.of(0), 4, "it says nothing of the cells");
    }
}
