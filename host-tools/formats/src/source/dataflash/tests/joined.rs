//! Joined logs in one file.

use super::*;

fn flight(firmware: &str, from: u64, letter: &str) -> Writer {
    let mut log = Writer::new();
    log.format(160, "MSG", "QZ", "TimeUS,Message");
    log.format(151, letter, "QB", "TimeUS,I");
    log.message(from as f64, firmware);
    for tenth in 10 * from..10 * from + 100 {
        log.raw(151, &[&(tenth * 100_000).to_le_bytes(), &[7]]);
        log.attitudes(tenth / 10..tenth / 10 + u64::from(tenth.is_multiple_of(10)));
    }
    log
}

fn kinds(seen: &Seen) -> Vec<VehicleKind> {
    let mut kinds = seen.find(|observation| match observation {
        Observation::Heartbeat(heartbeat) => Some(heartbeat.kind),
        _ => None,
    });
    kinds.dedup();
    kinds
}

#[test]
fn a_log_that_was_joined_to_another_is_another_recording_whatever_its_clock_says() {
    let first = flight("ArduPlane V4.5.7 (aaaaaaaa)", 20, "AAA").bytes;
    for from in [5, 20, 31, 700] {
        let second = flight("ArduCopter V4.5.7 (bbbbbbbb)", from, "BBB").bytes;
        for (cut, wrong) in [(0, false), (5, false), (0, true)] {
            let mut all = first[..first.len() - cut].to_vec();
            if wrong {
                let time = all.len() - 9;
                all[time..time + 8].copy_from_slice(&68_000_000_u64.to_le_bytes());
            }
            all.extend(&second);
            let seen = seen(&all);
            assert_eq!((seen.restarts, seen.joints.len()), (0, 1), "{from} {cut} {wrong} {:?}", seen.gaps);
            let end = seen.joints[0];
            assert!((29_700..=29_900).contains(&end), "{end}");
            assert_eq!(seen.last.as_millis(), end + 9_900);
            assert_eq!(seen.damage().len(), usize::from(cut > 0 || wrong), "{:?}", seen.gaps);
            assert_eq!(kinds(&seen), [VehicleKind::Plane, VehicleKind::Rotorcraft]);
            assert_eq!(seen.rows.iter().filter(|row| row.starts_with("BBB")).count(), 100);
        }
    }
}

#[test]
fn a_text_log_that_was_joined_to_another_is_another_recording() {
    let log = |firmware: &str, from: u64, letter: &str| {
        let mut log = format!(
            "58\n\n{firmware}\nAPM 2\nFMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n\
             FMT, 150, 13, {letter}, Qc, TimeUS,Roll\n"
        );
        log.extend((from..from + 100).map(|tenth| format!("{letter}, {tenth}00000, 1.5\n")));
        log
    };
    let (first, second) =
        (log("ArduPlane V4.5.7 (aaaaaaaa)", 200, "AAA"), log("ArduCopter V4.5.7 (bbbbbbbb)", 50, "BBB"));
    for cut in [0, 4] {
        let all = [&first[..first.len() - cut], &second].concat();
        let seen = seen(all.as_bytes());
        assert_eq!((seen.restarts, seen.joints.len()), (0, 1), "{:?}", seen.gaps);
        assert_eq!(seen.last.as_millis(), seen.joints[0] + 9_900);
        assert_eq!(kinds(&seen), [VehicleKind::Plane, VehicleKind::Rotorcraft]);
        assert_eq!(seen.rows.iter().filter(|row| row.starts_with("BBB")).count(), 100);
        assert_eq!(seen.gaps.len(), 0, "{:?}", seen.gaps);
    }
}
