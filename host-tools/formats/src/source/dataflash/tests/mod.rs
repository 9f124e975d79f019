//! Logs as they should be, as old autopilots wrote them, and as no autopilot would.

mod arming;
mod estimator;
mod hostile;
mod joined;
mod names;
mod time;
mod writer;

use anyhow::Result;
use hums_core::clock::Instant;
use hums_core::observation::{LandedState, Observation, VehicleKind};

use self::writer::Writer;
use super::*;
use crate::mavlink::values::Scalar;
use crate::source::item::{Amount, CellValue, Item, Rows};

#[derive(Debug, Default)]
struct Seen {
    observations: Vec<(u64, Observation)>,
    rows: Vec<String>,
    said: Vec<String>,
    gaps: Vec<(Cause, u64, u64, String)>,
    restarts: usize,
    joints: Vec<u64>,
    tables: Vec<(String, Vec<(String, String)>)>,
    last: Instant,
}

impl Seen {
    fn take(&mut self, at: Instant, item: Item<'_>) {
        assert!(at >= self.last, "time falls");
        self.last = at;
        match item {
            Item::Observation(_, observation) => self.observations.push((at.as_millis(), *observation)),
            Item::Row(row) => {
                let columns = row.table.columns.iter();
                let columns = columns.map(|column| (column.name.clone(), column.unit.clone())).collect();
                let table = (row.table.name.clone(), columns);
                if !self.tables.contains(&table) {
                    self.tables.push(table);
                }
                let values = row.values.iter().map(|value| match value {
                    CellValue::Unknown => "?".to_owned(),
                    CellValue::Number(Scalar::Unsigned(value)) => value.to_string(),
                    CellValue::Number(Scalar::Signed(value)) => value.to_string(),
                    CellValue::Number(Scalar::Single(value)) => value.to_string(),
                    CellValue::Number(Scalar::Double(value)) => value.to_string(),
                    CellValue::Flag(value) => value.to_string(),
                    CellValue::Text(value) => (*value).to_owned(),
                    CellValue::Bytes(value) => format!("{value:02x?}"),
                });
                assert_eq!(row.values.len(), row.table.columns.len());
                self.rows.push(format!("{} {}", row.table.name, values.collect::<Vec<_>>().join(" ")));
            }
            Item::Gap(gap) => {
                self.gaps.push((gap.cause, gap.place.unwrap_or(u64::MAX), gap.bytes, gap.words.clone()));
            }
            Item::Restart => self.restarts += 1,
            Item::Joint => self.joints.push(at.as_millis()),
            Item::Parameter(parameter) => self.said.push(format!("{}={}", parameter.name, parameter.value)),
            Item::Text(text) => self.said.push(text.words.to_owned()),
            Item::Mode(mode) => self.said.push(mode.name.unwrap_or("?").to_owned()),
            Item::Event(event) => self.said.push(event.words.to_owned()),
            Item::Fact(fact) => self.said.push(format!("{:?}: {}", fact.about, fact.words)),
            Item::Epoch(utc_us) => self.said.push(format!("epoch {utc_us}")),
            Item::Frame(_) | Item::Record(_) => {}
        }
    }

    /// Gaps that have a place in the file.
    fn damage(&self) -> Vec<&(Cause, u64, u64, String)> {
        self.gaps.iter().filter(|gap| gap.1 != u64::MAX).collect()
    }

    fn find<T>(&self, pick: impl Fn(&Observation) -> Option<T>) -> Vec<T> {
        self.observations.iter().filter_map(|(_, observation)| pick(observation)).collect()
    }
}

fn read(bytes: &[u8]) -> Result<(Seen, RecordingSummary)> {
    let form = detect(bytes).unwrap_or(Form::Binary);
    let want = Needs { observations: true, rows: Rows::All, ..Needs::default() };
    let mut seen = Seen::default();
    let mut take = |at: Instant, item: Item<'_>| {
        seen.take(at, item);
        Ok(())
    };
    let summary = match form {
        Form::Binary => binary(bytes, want, &mut take),
        Form::Text => text(bytes, want, &mut take),
    }?;
    Ok((seen, summary))
}

fn seen(bytes: &[u8]) -> Seen {
    read(bytes).expect("a log").0
}

#[test]
fn every_format_character_is_read_with_its_scale() {
    let mut log = Writer::new();
    log.format(150, "ALL1", "bBhHiIfd", "b,B,h,H,i,I,f,d");
    log.format(151, "ALL2", "nNcCeELMqQga", "n,N,c,C,e,E,L,M,q,Q,g,a");
    log.raw(
        150,
        &[
            &(-5_i8).to_le_bytes()[..],
            &[250],
            &(-300_i16).to_le_bytes(),
            &60_000_u16.to_le_bytes(),
            &(-70_000_i32).to_le_bytes(),
            &4_000_000_000_u32.to_le_bytes(),
            &1.5_f32.to_le_bytes(),
            &(-2.25_f64).to_le_bytes(),
        ],
    );
    let array: Vec<u8> = (0..32_i16).flat_map(|number| (number - 16).to_le_bytes()).collect();
    log.raw(
        151,
        &[
            b"ab\0\0",
            b"sixteen letters!",
            &(-1_234_i16).to_le_bytes(),
            &65_535_u16.to_le_bytes(),
            &(-123_456_i32).to_le_bytes(),
            &4_294_967_295_u32.to_le_bytes(),
            &(-353_632_610_i32).to_le_bytes(),
            &[19],
            &i64::MIN.to_le_bytes(),
            &u64::MAX.to_le_bytes(),
            &0xC100_u16.to_le_bytes(),
            &array,
        ],
    );
    let seen = seen(&log.bytes);
    assert_eq!(seen.rows[3], "ALL1 -5 250 -300 60000 -70000 4000000000 1.5 -2.25");
    let numbers: Vec<String> = (-16..16).map(|number: i16| number.to_string()).collect();
    let expected = format!(
        "ALL2 ab sixteen letters! -12.34 655.35 -1234.56 42949672.95 -35.363261 19 -9223372036854775808 \
         18446744073709551615 -2.5 {}",
        numbers.join(" ")
    );
    assert_eq!(seen.rows[4], expected);
    assert!(seen.damage().is_empty(), "{:?}", seen.gaps);
}

#[test]
fn units_come_with_their_multipliers_though_they_are_told_after_the_first_rows() {
    let mut log = Writer::new();
    log.format(150, "BAT", "Qfc", "TimeUS,CurrTot,Temp");
    log.raw(150, &[&1_000_000_u64.to_le_bytes(), &10_f32.to_le_bytes(), &2_500_i16.to_le_bytes()]);
    log.units(150, "siO", "F!B");
    let seen = seen(&log.bytes);
    let columns = &seen.tables.iter().find(|(name, _)| name == "BAT").expect("rows").1;
    let units: Vec<&str> = columns.iter().map(|(_, unit)| unit.as_str()).collect();
    // By the format character.
    assert_eq!(units, ["us", "mAh", "degC"]);
}

#[test]
fn a_definition_that_changes_gets_a_table_of_its_own() {
    let mut log = Writer::new();
    log.format(150, "X", "QB", "TimeUS,A");
    log.raw(150, &[&1_u64.to_le_bytes(), &[1]]);
    log.format(150, "X", "QH", "TimeUS,B");
    log.raw(150, &[&2_u64.to_le_bytes(), &[2, 0]]);
    let (seen, summary) = read(&log.bytes).expect("a log");
    assert_eq!(seen.rows.iter().filter(|row| row.starts_with('X')).collect::<Vec<_>>(), ["X 1 1", "X_2 2 2"]);
    let count = summary.messages.iter().find(|message| message.name == "X").expect("counted");
    assert_eq!(count.amount, Amount { count: 2, bytes: 12 + 13 });
}

#[test]
fn lost_bytes_cost_the_message_that_they_were_of_and_no_other() {
    let mut log = Writer::new();
    log.attitudes(0..3);
    let start = log.bytes.len();
    log.attitudes(3..4);
    log.bytes.truncate(start + 9);
    log.attitudes(4..6);
    let (seen, _) = read(&log.bytes).expect("a log");
    let rolls: Vec<&String> = seen.rows.iter().filter(|row| row.starts_with("ATT")).collect();
    assert_eq!(rolls.len(), 5, "{rolls:?}");
    let words = "a message of type 150 that is not whole".to_owned();
    assert_eq!(seen.damage(), [&(Cause::Damaged, start as u64, 9, words)]);
}

#[test]
fn changed_bytes_between_messages_are_told_with_their_place() {
    let mut log = Writer::new();
    log.attitudes(0..2);
    let start = log.bytes.len();
    log.bytes.extend([7; 40]);
    log.attitudes(2..4);
    let seen = seen(&log.bytes);
    assert_eq!(seen.rows.iter().filter(|row| row.starts_with("ATT")).count(), 4);
    assert_eq!(seen.gaps, [(Cause::Damaged, start as u64, 40, "no message begins here".into())]);
}

#[test]
fn zeros_and_half_a_message_at_the_end_are_a_log_that_was_cut() {
    for (tail, bytes, words) in
        [(vec![0; 3_000], 3_000, "nothing but zeros"), (vec![0xff; 500], 500, "erased")]
    {
        let mut log = Writer::new();
        log.attitudes(0..2);
        log.bytes.extend(&tail);
        let seen = seen(&log.bytes);
        let (cause, _, count, told) = &seen.gaps[0];
        assert_eq!((*cause, *count, seen.gaps.len()), (Cause::Cut, bytes, 1));
        assert!(told.contains(words), "{told}");
    }
    let mut log = Writer::new();
    log.attitudes(0..2);
    log.bytes.pop();
    let seen = seen(&log.bytes);
    assert_eq!(
        (seen.gaps[0].0, seen.rows.iter().filter(|row| row.starts_with("ATT")).count()),
        (Cause::Cut, 1)
    );
}

#[test]
fn a_message_that_is_defined_late_is_told_and_read_from_then_on() {
    let mut log = Writer::new();
    log.attitudes(0..1);
    let start = log.bytes.len() as u64;
    log.raw(160, &[&9_u64.to_le_bytes(), &[1]]);
    log.attitudes(1..2);
    log.format(160, "LATE", "QB", "TimeUS,A");
    log.raw(160, &[&2_100_000_u64.to_le_bytes(), &[2]]);
    let seen = seen(&log.bytes);
    assert!(seen.rows.contains(&"LATE 2100000 2".to_owned()), "{:?}", seen.rows);
    let words = "a message of type 160, which no FMT has defined before it".to_owned();
    assert_eq!(seen.damage(), [&(Cause::Damaged, start, 12, words)]);
}

#[test]
fn a_length_that_lies_is_corrected_by_the_columns() {
    let mut log = Writer::new();
    log.format_of(160, 30, "LIES", "QB", "TimeUS,A");
    for number in 0..4 {
        log.raw(160, &[&u64::from(number).to_le_bytes(), &[number]]);
    }
    let seen = seen(&log.bytes);
    let rows: Vec<&String> = seen.rows.iter().filter(|row| row.starts_with("LIES")).collect();
    assert_eq!(rows, ["LIES 0 0", "LIES 1 1", "LIES 2 2", "LIES 3 3"]);
}

#[test]
fn a_definition_whose_length_lies_is_told_with_its_place_when_the_first_message_comes() {
    for (length, characters, words) in [
        (0, "QB", "has 0 bytes, and its columns make 12: which its messages are taken to have"),
        (10, "QB", "has 10 bytes, and its columns make 12: those that do not fit are not read"),
        (30, "QB", "has 30 bytes, and its columns make 12: what is behind its columns is not read"),
        (89, "QZZZZ", "has 89 bytes, and its columns make 267: those that do not fit are not read"),
    ] {
        let mut log = Writer::new();
        log.attitudes(0..1);
        log.format_of(160, length, "LIES", characters, "TimeUS,A");
        let start = log.bytes.len() as u64;
        assert!(seen(&log.bytes).gaps.is_empty(), "it has no message");
        log.raw(160, &[&1_u64.to_le_bytes(), &[1]]);
        log.bytes.resize(start as usize + usize::from(length).max(12), 0);
        log.attitudes(1..3);
        let seen = seen(&log.bytes);
        let told = seen.gaps.first().expect("told");
        assert_eq!((told.0, told.1), (Cause::Damaged, start), "{:?}", seen.gaps);
        assert!(told.3.contains(words), "{}", told.3);
    }
    let text = "FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n\
        FMT, 13, 99, EV, IB, TimeMS,Id\nEV, 1000, 10\n";
    assert!(seen(text.as_bytes()).gaps.is_empty(), "lines have no lengths");
}

#[test]
fn the_content_of_a_file_comes_with_its_zeros_and_what_is_no_number_as_it_is() {
    let mut log = Writer::new();
    log.format(160, "FILE", "NIBZ", "FileName,Offset,Length,Data");
    log.format(161, "X", "Qfd", "TimeUS,A,B");
    let mut data = [0; 64];
    data[..5].copy_from_slice(b"a\0\xffb\0");
    log.raw(160, &[b"@SYS/uarts.txt\0\0", &0_u32.to_le_bytes(), &[5], &data]);
    log.raw(161, &[&1_u64.to_le_bytes(), &f32::NAN.to_le_bytes(), &f64::NEG_INFINITY.to_le_bytes()]);
    let rows = seen(&log.bytes).rows;
    let row = |name: &str| rows.iter().find(|row| row.starts_with(name)).cloned().expect("a row");
    assert_eq!(row("FILE @"), format!("FILE @SYS/uarts.txt 0 5 {data:02x?}"));
    assert_eq!(row("X "), "X 1 NaN -inf");
}

#[test]
fn words_in_the_place_of_a_number_are_kept_in_a_text_log() {
    let log = "ArduCopter V3.1\nFMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n\
        FMT, 3, 6, MODE, Mh, Mode,ThrCrs\nFMT, 4, 6, ODD, hh, A,B\n\
        MODE, Stabilize, 424\nMODE, 5, 424\nODD, high, 7\n";
    let seen = seen(log.as_bytes());
    let rows: Vec<&String> = seen.rows.iter().filter(|row| !row.starts_with("FMT")).collect();
    assert_eq!(rows, ["MODE Stabilize 424", "MODE 5 424", "ODD high 7"]);
    assert!(seen.said.contains(&"STABILIZE".to_owned()), "{:?}", seen.said);
}

#[test]
fn an_angle_that_is_none_is_no_attitude() {
    let mut log = Writer::new();
    log.format(150, "ATT", "Qfff", "TimeUS,Roll,Pitch,Yaw");
    for (second, roll) in [(1_u64, 10.0_f32), (2, 3.4e38), (3, -361.0), (4, 11.0)] {
        let angles = [roll, 1.0, 359.0].map(f32::to_le_bytes).concat();
        log.raw(150, &[&(second * 1_000_000).to_le_bytes(), &angles]);
    }
    let attitudes = seen(&log.bytes).find(|seen| matches!(seen, Observation::Attitude(_)).then_some(()));
    assert_eq!(attitudes.len(), 2);
}

#[test]
fn the_attitude_that_is_wanted_stands_beside_the_one_that_is() {
    let mut log = Writer::new();
    log.format(150, "ATT", "Qfffff", "TimeUS,DesRoll,Roll,DesPitch,Pitch,Yaw");
    for (second, wanted) in [(1_u64, 40.0_f32), (2, f32::NAN), (3, 3.4e38)] {
        let angles = [wanted, 38.0, -5.0, -4.0, 359.0].map(f32::to_le_bytes).concat();
        log.raw(150, &[&(second * 1_000_000).to_le_bytes(), &angles]);
    }
    let seen = seen(&log.bytes);
    let wanted = seen.find(|seen| match seen {
        Observation::AttitudeSetpoint(wanted) => {
            Some([wanted.roll.0, wanted.pitch.0].map(|angle| angle.to_degrees().round()))
        }
        _ => None,
    });
    assert_eq!(wanted, [[40.0, -5.0]]);
    assert_eq!(seen.find(|seen| matches!(seen, Observation::Attitude(_)).then_some(())).len(), 3);
}

#[test]
fn the_second_estimator_has_a_place_where_the_first_one_is_logged_with_one() {
    let second = |with_positions: bool| {
        let mut log = Writer::new();
        log.format(150, "AHR2", "QccCfLL", "TimeUS,Roll,Pitch,Yaw,Alt,Lat,Lng");
        log.format(151, "POS", "QLLff", "TimeUS,Lat,Lng,Alt,RelHomeAlt");
        let place = [-353_632_620_i32, 1_491_652_370].map(i32::to_le_bytes).concat();
        let heights = [590.0_f32, 6.0].map(f32::to_le_bytes).concat();
        if with_positions {
            log.raw(151, &[&1_000_000_u64.to_le_bytes(), &place, &heights]);
        }
        let angles = [1_250_i16, -330].map(i16::to_le_bytes).concat();
        let (yaw, altitude) = (35_000_u16.to_le_bytes(), 588.5_f32.to_le_bytes());
        log.raw(150, &[&1_100_000_u64.to_le_bytes(), &angles, &yaw, &altitude, &place]);
        let found = seen(&log.bytes).find(|seen| match seen {
            Observation::SecondEstimate(second) => Some(*second),
            _ => None,
        });
        let [second] = found[..] else { panic!("{found:?}") };
        let degrees = second.attitude.map(|angles| angles.map(|angle| (angle.0.to_degrees() * 10.0).round()));
        assert_eq!(degrees, Some([125.0, -33.0, -100.0]));
        (second.altitude.map(|metres| metres.0), second.position.map(|place| place.latitude_deg))
    };
    assert_eq!(second(true), (Some(588.5), Some(-35.363_262)));
    assert_eq!(second(false), (None, None));
}

#[test]
fn the_climb_that_is_wanted_is_in_centimetres_where_it_is_whole() {
    let wanted = |kind: &str, value: &[u8]| {
        let mut log = Writer::new();
        log.format(150, "CTUN", &format!("Qf{kind}"), "TimeUS,ThO,DCRt");
        log.raw(150, &[&1_000_000_u64.to_le_bytes(), &0.5_f32.to_le_bytes(), value]);
        seen(&log.bytes).find(|seen| match seen {
            Observation::ClimbWanted(climb) => Some(climb.0),
            _ => None,
        })
    };
    assert_eq!(wanted("h", &(-924_i16).to_le_bytes()), [-9.24]);
    assert_eq!(wanted("f", &(-2.5_f32).to_le_bytes()), [-2.5]);
}

#[test]
fn failsafes_are_in_force_by_name_until_they_are_resolved_or_it_is_disarmed() {
    let mut log = Writer::new();
    log.format(160, "MSG", "QZ", "TimeUS,Message");
    log.format(161, "EV", "QB", "TimeUS,Id");
    log.format(162, "ERR", "QBB", "TimeUS,Subsys,ECode");
    log.message(1.0, "ArduCopter V4.6.3 (92b0cd78)");
    log.raw(161, &[&1_100_000_u64.to_le_bytes(), &[10]]);
    let state = |log: &Writer| {
        let seen = seen(&log.bytes);
        let states = seen.find(|seen| match seen {
            Observation::Heartbeat(heartbeat) => Some(heartbeat.state),
            _ => None,
        });
        let said = seen.said.iter().rev().find(|said| said.starts_with("Failsafes: ")).cloned();
        (states.last().copied(), said.unwrap_or_default())
    };
    for subsystem in [5, 6, 7, 8, 9, 17, 19, 20, 23, 25, 26, 27, 29, 30, 31] {
        let mut log = log.clone();
        log.raw(162, &[&2_000_000_u64.to_le_bytes(), &[subsystem, 1]]);
        log.attitudes(2..4);
        assert_eq!(state(&log).0, Some(5), "subsystem {subsystem}");
        log.raw(162, &[&4_000_000_u64.to_le_bytes(), &[subsystem, 0]]);
        log.attitudes(5..6);
        assert_eq!(state(&log), (Some(3), "Failsafes: ".to_owned()), "subsystem {subsystem}");
    }
    log.raw(162, &[&2_000_000_u64.to_le_bytes(), &[29, 1]]);
    log.raw(162, &[&2_100_000_u64.to_le_bytes(), &[6, 1]]);
    log.attitudes(3..4);
    assert_eq!(state(&log).1, "Failsafes: battery failsafe, vibration failsafe");
    log.raw(162, &[&4_000_000_u64.to_le_bytes(), &[12, 1]]);
    log.raw(161, &[&4_000_000_u64.to_le_bytes(), &[11]]);
    log.attitudes(5..6);
    assert_eq!(state(&log), (Some(3), "Failsafes: ".to_owned()));
    assert!(seen(&log.bytes).said.contains(&"Emergency: crash check".to_owned()));
}

#[test]
fn another_power_on_in_one_file_is_a_restart_and_time_goes_on() {
    let mut log = Writer::new();
    log.attitudes(100..110);
    log.attitudes(1..13);
    let seen = seen(&log.bytes);
    assert_eq!(seen.restarts, 1);
    assert_eq!(seen.last.as_millis(), 109_000 + 11_000);
}

#[test]
fn one_damaged_time_moves_nothing() {
    let mut log = Writer::new();
    log.attitudes(1..3);
    log.attitudes(500_000..500_001);
    log.attitudes(3..5);
    let seen = seen(&log.bytes);
    assert_eq!((seen.last.as_millis(), seen.restarts), (4_000, 0));
    assert_eq!(seen.find(|seen| matches!(seen, Observation::Attitude(_)).then_some(())).len(), 4);
    assert_eq!(seen.rows.iter().filter(|row| row.starts_with("ATT")).count(), 5, "rows are as they stand");
}

#[test]
fn a_pause_of_the_logger_is_a_gap_from_its_beginning_to_its_end() {
    let mut log = Writer::new();
    log.attitudes(1..3);
    log.attitudes(3_000..3_002);
    let seen = seen(&log.bytes);
    assert_eq!(seen.last.as_millis(), 3_001_000);
    assert_eq!(
        seen.gaps.last().map(|gap| (gap.0, gap.3.as_str())),
        Some((Cause::NotKept, "nothing was written"))
    );
}

#[test]
fn a_copter_of_today_arms_leaves_the_ground_and_lands() {
    let mut log = Writer::new();
    log.format(160, "MSG", "QZ", "TimeUS,Message");
    log.format(161, "EV", "QB", "TimeUS,Id");
    log.format(162, "ERR", "QBB", "TimeUS,Subsys,ECode");
    log.format(163, "MODE", "QMBB", "TimeUS,Mode,ModeNum,Rsn");
    log.message(1.0, "ArduCopter V4.6.3 (92b0cd78)");
    log.raw(163, &[&1_000_000_u64.to_le_bytes(), &[4, 4, 1]]);
    for (second, event) in [(2_u64, 10), (5, 28), (9, 18), (10, 11)] {
        log.attitudes(second..second + 1);
        log.raw(161, &[&(second * 1_000_000 + 1).to_le_bytes(), &[event]]);
    }
    log.raw(162, &[&10_500_000_u64.to_le_bytes(), &[5, 1]]);
    log.attitudes(11..12);
    let seen = seen(&log.bytes);
    let armed = seen.find(|seen| match seen {
        Observation::Heartbeat(heartbeat) => Some((heartbeat.kind, heartbeat.armed, heartbeat.mode)),
        _ => None,
    });
    let kind = VehicleKind::Rotorcraft;
    let mut changes = armed.clone();
    changes.dedup();
    assert_eq!(changes, [(kind, false, 0), (kind, false, 4), (kind, true, 4), (kind, false, 4)]);
    let mut landed = seen.find(|seen| match seen {
        Observation::Landed(landed, _) => Some(*landed),
        _ => None,
    });
    landed.dedup();
    // GUIDED climbs by itself.
    assert_eq!(landed, [LandedState::OnGround, LandedState::TakingOff, LandedState::OnGround]);
    let states = seen.find(|seen| match seen {
        Observation::Heartbeat(heartbeat) => Some(heartbeat.state),
        _ => None,
    });
    assert_eq!(states.last(), Some(&5), "a radio failsafe is a critical state");
    for words in ["GUIDED", "armed", "left the ground", "radio failsafe: occurred"] {
        assert!(seen.said.iter().any(|said| said == words), "{words}: {:?}", seen.said);
    }
}

#[test]
fn a_text_log_of_2013_without_any_clock_but_the_receivers_is_read() {
    let log = "\n1\n\nArduCopter V3.0.1\nFree RAM: 1696\n\
        FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format\n\
        FMT, 129, 23, PARM, Nf, Name,Value\n\
        FMT, 130, 35, GPS, BIBcLLeeEef, Status,Time,NSats,HDop,Lat,Lng,RelAlt,Alt,Spd,GCrs,VZ\n\
        FMT, 1, 17, ATT, cccccCC, RollIn,Roll,PitchIn,Pitch,YawIn,Yaw,NavYaw\n\
        FMT, 3, 6, MODE, Mh, Mode,ThrCrs\nFMT, 4, 7, CTUN, hh, ThrOut,CRate\n\
        PARM, RC1_MIN, 1100.000000\nMODE, STABILIZE, 350\nCTUN, 400, 250\n\
        GPS, 3, 594438200, 9, 1.68, 44.0290459, -77.7367640, 3.13, 91.56, 0.00, 0.00, -0.5\n\
        ATT, 0.00, 0.47, 0.00, -8.53, 0.00, 111.24, 111.24\n\
        NOPE, 1\n\
        GPS, 3, 594439400, 9, 1.68, 44.0290459, -77.7367640, 5.13, 93.56, 0.00, 0.00, -0.5\n\
        ATT, 0.00, 90.00";
    let seen = seen(log.as_bytes());
    assert_eq!(seen.last.as_millis(), 1_200);
    assert!(seen.said.contains(&"Firmware: ArduCopter V3.0.1".to_owned()), "{:?}", seen.said);
    assert!(seen.said.contains(&"STABILIZE".to_owned()) && seen.said.contains(&"RC1_MIN=1100".to_owned()));
    let heights = seen.find(|seen| match seen {
        Observation::GlobalPosition(position) => Some([position.relative_altitude.0, position.velocity[2].0]),
        _ => None,
    });
    assert_eq!(heights, [[3.13, 0.0], [5.13, -2.5]], "not the climb of the receiver");
    let attitude = seen.find(|seen| match seen {
        Observation::Attitude(attitude) => Some((attitude.roll.0.to_degrees(), attitude.boot_ms)),
        _ => None,
    });
    assert!(matches!(attitude[..], [(roll, None)] if (roll - 0.47).abs() < 1e-4), "{attitude:?}");
    let gaps: Vec<_> = seen.gaps.iter().map(|(cause, .., words)| (*cause, words.as_str())).collect();
    assert_eq!(
        gaps,
        [
            (Cause::Damaged, "a line that begins with \"NOPE\", which no FMT has defined before it"),
            (Cause::NotKept, "nothing was written"),
            (Cause::Cut, "a line of ATT with 2 of 7 values"),
        ]
    );
}

#[test]
fn a_log_without_any_time_says_so() {
    let log = "ArduCopter V3.0.1\n\
        FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format\n\
        FMT, 13, 4, EV, B, Id\n\
        FMT, 1, 17, ATT, ccc, Roll,Pitch,Yaw\n\
        EV, 10\nATT, 0.00, 0.47, 0.00\nATT, 0.00, 0.47, 0.00\n";
    let seen = seen(log.as_bytes());
    let [(cause, _, 0, words)] = seen.gaps.as_slice() else { panic!("{:?}", seen.gaps) };
    assert_eq!(*cause, Cause::NoTimes);
    assert!(words.starts_with("none of 6 messages has a time"), "{words}");
    assert!(cause.is_damage(), "exit code 3");
}

#[test]
fn a_log_is_detected_by_what_stands_in_it() {
    let mut log = Writer::new();
    log.attitudes(0..1);
    assert_eq!(detect(&log.bytes), Some(Form::Binary));
    assert_eq!(detect(b"ArduCopter V3.1\r\n\nFMT, 128, 89, FMT"), Some(Form::Text));
    assert_eq!(detect(b"\x00\x00"), None);
}

#[test]
fn the_version_that_a_message_tells_is_handed_on_where_no_ver_does() {
    let mut log = Writer::new();
    log.format(160, "MSG", "QZ", "TimeUS,Message");
    log.message(1.0, "ArduCopter V4.5.1 (abcdef12)");
    log.attitudes(1..9);
    log.message(9.0, "ArduCopter V4.5.1 (abcdef12)");
    let seen = seen(&log.bytes);
    let told = seen.observations.iter().filter_map(|(_, observation)| match observation {
        Observation::Identity(identity) => Some(identity.firmware >> 8),
        _ => None,
    });
    assert_eq!(told.collect::<Vec<_>>(), [0x0004_0501]);
}
