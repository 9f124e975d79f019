//! Speeds and currents of motors against each other: frames, turning, standing and pushing motors.
#![expect(clippy::panic, reason = "that is how a test fails")]

use crate::common::{AUTOPILOT, Quad, Run, Script, observe, rows};
use hums_core::health::{Finding, Level};
use hums_core::observation::{Attitude, Autopilot, Esc, EscGroup, Observation, Outputs};
use hums_core::parameters::Params;
use hums_core::units::{Amperes, Celsius, Radians, RadiansPerSecond, Rpm};

/// A minute of flight; the findings about motors. Words besides the vehicle's: `rpm` and `amp` of each ESC, `yaw`, its rate; `out`, the
/// pulses of its outputs, others of 900 us or `fill`; `servo`, an output at its end; `varies`, pulses within the range in each
/// other second; `dshot` and `can`, `PX4`'s numbers, whose motors idle above zero.
fn told(script: &str) -> Vec<(&'static str, u8)> {
    let (mut run, script) = (Run::new(&Params::defaults()), Script::new(script));
    run.says(0..60_000, |now_ms| {
        let mut quad = Quad::healthy();
        let (mut rpm, mut amperes, mut given) = (vec![], vec![], vec![]);
        let (mut yaw, mut fill, mut servo) = (0.0, 900.0, None);
        let mut make: Vec<Box<dyn Fn(f32) -> f32>> = Vec::new();
        let is_odd = !(now_ms / 1_000).is_multiple_of(2);
        script.play(now_ms as i64, |said| match said.name() {
            _ if quad.take(said) => {}
            "rpm" => rpm = said.more(0).to_vec(),
            "amp" => amperes = said.more(0).to_vec(),
            "yaw" => yaw = said.number(),
            "out" => given = said.more(0).to_vec(),
            "fill" => fill = said.number(),
            "servo" => servo = Some(2_000.0),
            "varies" => {
                let more = if is_odd { said.number() } else { 0.0 };
                let varies =
                    move |pulse| if (1_000.0..1_900.0).contains(&pulse) { pulse + more } else { pulse };
                make.push(Box::new(varies));
            }
            "dshot" => make.push(Box::new(|pulse| number_of(pulse, 1.999, 110.0))),
            "can" => make.push(Box::new(|pulse| number_of(pulse, 8.191, 1.0))),
            word => panic!("{word}: no word"),
        });
        let plain = if amperes.is_empty() { quad.escs[0].unwrap_or_default() } else { Esc::default() };
        let esc = |place: usize| {
            let rpm = rpm.get(place).copied().map(Rpm);
            let current = amperes.get(place).copied().map(Amperes);
            (rpm.is_some() || current.is_some()).then(|| Esc {
                rpm,
                current: current.or(plain.current),
                ..plain
            })
        };
        let group = |first: usize| {
            let escs = [0, 1, 2, 3].map(|place| esc(first + place));
            Observation::Escs(EscGroup { first: first as u8, escs })
        };
        let rates = Some([0.0, 0.0, yaw].map(RadiansPerSecond));
        let attitude = Attitude { roll: Radians(quad.roll.max(0.02)), rates, ..Attitude::default() };
        let pulses = core::array::from_fn(|place| {
            let unused = servo.filter(|_| place == 5).unwrap_or(fill);
            let pulse = given.get(place).copied().unwrap_or(unused);
            make.iter().fold(pulse, |pulse, make| make(pulse)) as u16
        });
        let outputs = (!given.is_empty()).then_some(Observation::Outputs(Outputs { port: 0, pulses }));
        let own = |said: &Observation| !matches!(said, Observation::Escs(_) | Observation::Attitude(_));
        let more = [Observation::Attitude(attitude), group(0), group(4)];
        quad.says(now_ms).into_iter().filter(own).chain(more).chain(outputs).collect()
    });
    let of_motors = run.findings.iter().filter(|finding| finding.check.starts_with("motor"));
    let mut told: Vec<_> = of_motors.map(|finding| (finding.check, finding.instance)).collect();
    told.dedup();
    told
}

fn number_of(pulse: f32, whole: f32, idle: f32) -> f32 {
    ((pulse - 1_000.0) * whole).max(if pulse < 1_000.0 { 0.0 } else { idle })
}

#[test]
fn an_esc_whose_messages_come_once_a_second_is_silent_after_five_of_them() {
    let told = |lost: u64| {
        let mut run = Run::new(&Params::defaults());
        run.flies(0..60_000, |now_ms, quad, more| {
            let is_heard = now_ms % 1_000 == 0 && !(30_000..30_000 + 1_000 * lost).contains(&now_ms);
            let second = Observation::Escs(EscGroup { first: 4, escs: quad.escs });
            more.extend(is_heard.then_some(second));
        });
        let critical = run.of_check("esc_silent").filter(|finding| finding.level == Level::Critical);
        critical.map(|one| ((one.at.as_millis() - 29_000) / 1_000, one.instance)).collect::<Vec<_>>()
    };
    assert_eq!(told(4), []);
    assert_eq!(told(6), [(5, 4), (5, 5), (5, 6), (5, 7)]);
}

const HEXA: &str = "* hexa rpm=5000x6; 20 ";
const QUAD: &str = "* rpm=5000x4; 20 ";
const QUADPLANE: &str = "* vtol mode=10 hover; 0-2 landed=ground; 2 landed=air; ";
const GIVEN: &str = "* px4 yaw=0.3 servo rpm=5000x4; 0-4 h=0 out=1000x4; 4 h=200 out=1500x4; 20 c=-4 ";
const AIRBORNE: &str = "* hexa start=20 landed=air fill=0 ";
const BEGINS: [(&str, &str); 5] =
    [("HEXA ", HEXA), ("QUAD ", QUAD), ("QUADPLANE ", QUADPLANE), ("GIVEN ", GIVEN), ("AIRBORNE ", AIRBORNE)];

/// A name, the findings of the motors, and the script. Its beginning may be one of the above.
const FLIGHTS: &str = "
a Y6's upper and lower motors | - | HEXA rpm=5100,3550,5050,3500,3520,5080 yaw=0.4
a yawing quad | - | QUAD rpm=4200,4150,5900,5950 yaw=0.5
a load that hangs before its middle | - | QUAD rpm=5800,4300,5750,4250
alone, in groups | motor_imbalance.5 | HEXA rpm=5100,3550,5050,3500,3520,7900
alone | motor_imbalance.1 | QUAD rpm=5000,6700,5050,4950
it turns fast | - | QUAD rpm=3200,4300,5300,6500 yaw=1.8
it turns slowly | motor_imbalance.3 | QUAD rpm=3200,4300,5300,6500 yaw=0.1
one stopped | motor_imbalance.2 | HEXA rpm=5900,6000,300,6200,6100,900 yaw=1.8
they idle on the ground | - | * thr=0.02 h=12 landed=air rpm=5000x4; 20 rpm=2200,2050,2900,800
a command that was cut | - | * amp=5x4 rpm=5000x4; 20%20:0-1.5 amp=5,0,5,5 rpm=5000,3900,5000,5000
the motor that pushes | - | QUADPLANE * amp=5x4,0
it helps for a while | - | QUADPLANE * amp=5x4,0; 10-30 amp=5x4,6
it returns | - | QUADPLANE 0-20 forward landed=air amp=0x4,12; 20-25 transition amp=5x4,12; 25 amp=5x4,3; 26 amp=5x4,0
one that lifts | motor_loss.2 | QUADPLANE * amp=5x4,0; 40 amp=5,5,0.1,5,0
stopped to turn | - | QUADPLANE * amp=5x4; 20 yaw=0.3 amp=0.05,0.2,9,8
one is lost | motor_loss.0 | QUADPLANE * amp=5x4; 20 yaw=0.3 amp=0.05,4,9,8
alone at its end for a moment | - | GIVEN ; 20-20.1 out=2000,1300,1350,1350
two share a turn | - | GIVEN out=2000,1800,1350,1350
all the thrust | - | GIVEN out=2000x4
the same of DShot | - | GIVEN out=2000,1800,1350,1350; * dshot
the same of CAN | - | GIVEN out=2000,1800,1350,1350; * can
it hovers with about 1000 of DShot | - | GIVEN out=1525x4; * dshot
the same of CAN | - | GIVEN out=1525x4; * can
outputs that are heard in the air first | motor_output.2 | * hexa fill=0 varies=30; 0-4 h=0; 10 out=1500,1480,1950,1510,1530,1600
they are well | - | * hexa fill=0 varies=30; 0-4 h=0; 10 out=1500,1480,1520,1510,1530,1600
a cut output of four | motor_imbalance.1 | * px4 yaw=0.3 rpm=5000x4; 0-4 h=0 out=1000x4; 4 h=200 out=1500x4; 20 rpm=5600,0,5400,5300 out=1525,900,1525,1525
dead before it was heard | motor_off.2 | AIRBORNE rpm=5000x6 varies=30 out=1500,1480,900,1510,1530,1600
weak before | motor_output.2 | AIRBORNE rpm=5000x6 varies=30 out=1500,1480,1950,1510,1530,1600
well | - | AIRBORNE rpm=5000x6 varies=30 out=1500,1480,1520,1510,1530,1600
what stands still is a servo | - | AIRBORNE rpm=5000x6 out=1500,1480,1950,1510,1530,1600
it is not used | - | AIRBORNE rpm=5000x6 varies=30 out=1500,1480,0,1510,1530,1600
others are near it | - | AIRBORNE rpm=5000x6 varies=30 out=1500,1480,1950,1700,1750,1600
";

#[test]
fn motors_are_judged_by_speeds_currents_and_outputs() {
    for [what, expected, script] in rows(FLIGHTS) {
        let found =
            told(&BEGINS.iter().fold(script.to_owned(), |all, (name, begin)| all.replace(name, begin)));
        let found: Vec<_> = found.iter().map(|(check, motor)| format!("{check}.{motor}")).collect();
        assert_eq!(found.join(" "), expected, "{what}");
    }
    for rpm in [0, 1_500, 6_500] {
        let script = format!("* amp=5x4 rpm=5000x4; 20%20:0-1.5 amp=5,0,5,5 rpm=5000,{rpm},5000,5000");
        assert!(told(&script).contains(&("motor_loss", 1)), "it stands or has no propeller: {rpm}");
    }
    let lost = told(&format!("{QUADPLANE}* amp=5x4; 20 yaw=2 amp=0.05,0.2,9,8"));
    assert_eq!(lost.len(), 2, "two of four are lost, and it spins");
}

#[test]
fn a_motor_that_is_idled_opposite_to_a_dead_one_is_not_a_second_dead_one() {
    let lost = |idled: u16| {
        let dead = format!("20 out=1550,2000,1550,1550,{idled},1550 amp=6,0.05,6,6,0.05,6");
        let mut told =
            told(&format!("* hexa yaw=0.3; 0-4 h=0 out=1000x6 amp=5x6; 4 out=1500x6 amp=5x6; {dead}"));
        told.retain(|(check, _)| *check == "motor_loss");
        told
    };
    assert_eq!(lost(1_000), [("motor_loss", 1)], "the autopilot gives it nothing");
    assert_eq!(lost(1_500), [("motor_loss", 1), ("motor_loss", 4)], "it is given as much as the others");
}

#[test]
fn a_motor_that_stands_while_it_is_given_all_is_lost_whatever_current_is_told_and_a_weak_one_is_named() {
    let has =
        |goes_on: &str, check| told(&format!("{GIVEN}{goes_on}")).into_iter().find(|(of, _)| *of == check);
    let all = "out=1700,1950,1700,1700";
    assert_eq!(has(&format!("rpm=5600,0,5400,5300 {all}"), "motor_loss"), Some(("motor_loss", 1)));
    assert_eq!(has("rpm=5600,0,5400,5300", "motor_loss"), None, "it carries: its speed is not told");
    assert_eq!(has(&format!("rpm=0x4 {all}"), "motor_loss"), None, "no ESC tells its speed");
    assert_eq!(has(&format!("rpm=5600,5900,5400,5300 {all}"), "motor_loss"), None, "it turns");
    for driver in ["", "; * dshot", "; * can"] {
        let weak = has(&format!("out=1950,1300,1350,1350{driver}"), "motor_output");
        assert_eq!(weak, Some(("motor_output", 0)), "alone at its end{driver}");
        let stands = told(&format!("{GIVEN}rpm=5600,0,5400,5300 out=1650,1950,1650,1650{driver}"));
        assert!(stands.contains(&("motor_loss", 1)), "{stands:?}{driver}");
        let out = told(&format!("{GIVEN}rpm=5600,0,5400,5300 out=1525,900,1525,1525{driver}"));
        assert!(
            !out.contains(&("motor_loss", 1)) && !out.contains(&("motor_imbalance", 1)),
            "{out:?}{driver}"
        );
    }
    let stands =
        told(&format!("{AIRBORNE}rpm=5000,5000,0,5000x3 varies=30 out=1500,1480,1950,1510,1530,1600"));
    assert!(stands.contains(&("motor_loss", 2)), "{stands:?}");
    let tilted =
        told("* roll=0.7; 0-4 h=0 out=1000x4; 4 h=40 out=1620,1600,1610,1630; 30 out=1620,1600,1610,2000");
    assert!(tilted.contains(&("motor_output", 3)), "{tilted:?}");
}

fn px4_escs(info: impl Fn(u64) -> Option<Esc>) -> Vec<Finding> {
    let mut run = Run::new(&Params::defaults());
    run.flies(0..90_000, |now_ms, quad, more| {
        quad.autopilot = Autopilot::Px4;
        for esc in quad.escs.iter_mut().flatten() {
            *esc = Esc { temperature: None, failures: None, errors: None, ..*esc };
        }
        let info = info(now_ms).map(|esc| EscGroup { first: 0, escs: [Some(esc); 4] });
        more.extend(info.map(Observation::Escs));
    });
    run.findings.into_iter().filter(|finding| finding.check.starts_with("esc")).collect()
}

#[test]
fn the_state_of_an_esc_is_as_old_as_its_own_message_however_often_its_speed_comes() {
    let good = Esc { temperature: Some(Celsius(45.0)), failures: Some(0), errors: Some(0), ..Esc::default() };
    let bad = [
        ("esc_failure", Esc { failures: Some(32), ..good }),
        ("esc_failure", Esc { failures: Some(4), ..good }),
        ("esc_temperature", Esc { temperature: Some(Celsius(140.0)), ..good }),
    ];
    for every_ms in [200, 1_000, 2_000, 4_000] {
        for (check, bad) in bad {
            let told = |messages: u64, last_ms: u64| {
                px4_escs(|now_ms| {
                    let is_bad = (30_000..30_000 + messages * every_ms).contains(&now_ms);
                    let is_sent = now_ms.is_multiple_of(every_ms) && now_ms < last_ms;
                    is_sent.then_some(if is_bad { bad } else { good })
                })
            };
            assert_eq!(told(1, 90_000), [], "one message is no alarm: {check} every {every_ms} ms");
            let more = told(2 + 2_000 / every_ms, 90_000);
            let alarms =
                |one: &&Finding| one.check == check && matches!(one.level, Level::Warning | Level::Critical);
            assert_eq!(more.iter().filter(alarms).count(), 4, "{check} every {every_ms} ms: {more:?}");
            let ends = told(0, 40_000);
            let mut stale = ends.iter().filter(|one| one.check == "esc_temperature");
            assert!(stale.all(|one| one.level == Level::Stale && one.at.as_millis() < 53_000), "{ends:?}");
            assert!(ends.iter().any(|one| one.check == "esc_temperature"), "stale every {every_ms} ms");
        }
    }
}

#[test]
fn a_temperature_that_is_no_longer_in_the_message_is_no_longer_known() {
    let info = |now_ms: u64| {
        let temperature = (now_ms < 30_000).then_some(Celsius(45.0));
        let esc = Esc { temperature, failures: Some(0), errors: Some(0), ..Esc::default() };
        now_ms.is_multiple_of(1_000).then_some(esc)
    };
    let told: Vec<_> = px4_escs(info).iter().map(|one| (one.check, one.level)).collect();
    assert_eq!(told, [("esc_temperature", Level::Stale); 4]);
}

#[test]
fn escs_on_a_link_that_slows_all_messages_alike_are_not_silent() {
    // Two groups of ESCs report five times a second, other parts ten times. After 30 s all report an eighth as often, or the ESCs stop.
    let silent = |is_slowed: bool| {
        let mut run = Run::new(&Params::defaults());
        run.steps(0..60_000, |now_ms, monitor| {
            let is_late = now_ms >= 30_000;
            let times = if is_late && is_slowed { 8 } else { 1 };
            let quad = Quad::healthy();
            let is_of_escs = |said: &Observation| matches!(said, Observation::Escs(_));
            let mut said = if now_ms % (100 * times) == 0 { quad.says(now_ms) } else { Vec::new() };
            said.retain(|one| !is_of_escs(one));
            for (first, after_ms) in [(0, 0), (4, 50)] {
                let reports = now_ms % (200 * times) == after_ms && (is_slowed || !is_late);
                said.extend(reports.then_some(Observation::Escs(EscGroup { first, escs: quad.escs })));
            }
            observe(monitor, now_ms, AUTOPILOT, said);
        });
        run.of_check("esc_silent").any(|one| matches!(one.level, Level::Warning | Level::Critical))
    };
    assert!(!silent(true));
    assert!(silent(false));
}
