//! Standing vehicles that report flight: on the bench, spooling up, landed by hand; and vehicles that fly though little says so.
#![expect(clippy::panic, reason = "that is how a test fails")]

use crate::common::{Quad, Run, Script, rows};
use hums_core::observation::{Air, Hud, Imu, Observation};
use hums_core::parameters::Params;
use hums_core::units::{Fraction, Hectopascals, Metres, MetresPerSecond, MetresPerSecond2, RadiansPerSecond};
use hums_core::usage::UsageCounter;

/// Flights and landings in two minutes of a vehicle that is armed after 5 s, and that its autopilot calls in the air. Words besides the
/// vehicle's: `nowhere`, without a position; `alt` and `up`, height and climb on the display; `speed` over ground; `turns`, a body
/// rate; `shake`, steps of the force, and `hpa`.
fn counts(script: &str) -> (u32, u32) {
    let script = Script::new(&format!("* landed=air c=0; 0-5 off; {script}"));
    let mut run = Run::new(&Params::defaults());
    run.says(0..120_000, |now_ms| {
        let (mut quad, mut hud, mut imu) = (Quad::healthy(), Hud::default(), Imu::default());
        let (mut is_nowhere, mut speed_mps, mut air) = (false, None, None);
        let noise = (now_ms / 100 % 3) as f32;
        script.play(now_ms as i64, |said| match said.name() {
            _ if quad.take(said) => {}
            "nowhere" => is_nowhere = true,
            "alt" => hud.altitude = Some(Metres(said.number())),
            "up" => hud.climb = Some(MetresPerSecond(said.number())),
            "speed" => speed_mps = Some(said.number()),
            "turns" => imu.rate = Some([said.number(), 0.0, 0.0].map(RadiansPerSecond)),
            "shake" => {
                let down = -9.8 + said.number() * noise;
                imu.acceleration = Some([0.0, 0.0, down].map(MetresPerSecond2));
                imu.rate = Some([RadiansPerSecond(0.01); 3]);
            }
            "hpa" => {
                let pressure = Some(Hectopascals(said.number() + 0.01 * noise));
                air = Some(Observation::Air(Air { pressure, ..Air::default() }));
            }
            word => panic!("{word}: no word"),
        });
        let mut said = quad.says(now_ms);
        said.retain(|one| !is_nowhere || !matches!(one, Observation::GlobalPosition(_)));
        for one in &mut said {
            match one {
                Observation::GlobalPosition(global) => {
                    if let Some(speed_mps) = speed_mps {
                        global.velocity = [speed_mps, 0.0, -quad.climb].map(MetresPerSecond);
                    }
                }
                Observation::Hud(own) => *own = Hud { throttle: Some(Fraction(quad.throttle)), ..hud },
                Observation::Imu(own) => {
                    own.acceleration = imu.acceleration.or(own.acceleration);
                    own.rate = imu.rate;
                }
                _ => {}
            }
        }
        said.extend(air);
        said
    });
    let [flights, landings, _] =
        run.counts([UsageCounter::Flights, UsageCounter::Landings, UsageCounter::Mishaps]);
    (flights, landings)
}

/// A name, flights and landings, and the script.
const STANDING: &str = "
it idles on the bench | 0 0 | * h=0.2 thr=0.12
it takes off from there | 1 0 | * h=0.2 thr=0.12; 40 thr=0.45; 42 h=10
received first in a hover at the height of home | 1 0 | * on h=0.3 thr=0.4
a pilot landed it and left it armed | 2 2 | * h=0.1 thr=0 speed=0; 10-50 h=8 thr=0.4; 80-100 h=8 thr=0.4
motors tried | 0 0 | * nowhere landed=- alt=480.3 thr=0; 20 alt=480.6 thr=0.6
the barometer rises | 1 0 | * nowhere landed=- alt=480.3 thr=0; 20 alt=486 thr=0.6
nothing tells its height | 0 0 | * nowhere thr=0 up=0.2
its height drifts by 6 m | 0 0 | * thr=0.02; 0-120 h=0..6
nobody says that it flies | 0 0 | * landed=- thr=0.02; 0-120 h=0..6
without propellers, all its throttle | 0 0 | * h=0.4 thr=0; 20 thr=1
a plane that stands | 0 0 | * plane h=0.3 thr=0
half a metre up, without a position | 1 0 | * nowhere thr=0 alt=480 up=0; 20 thr=0.3 alt=480.5; 20-21 up=0.5
with its motor off | 1 0 | * plane h=60 thr=0 c=-1 speed=14
it descends without throttle | 1 0 | * nowhere thr=0.5 up=0; 60 thr=0 up=-4
a simulator that hovers | 1 0 | * on thr=0.5 shake=0.03 hpa=960
";

#[test]
fn what_stands_does_not_fly_and_what_flies_does_whatever_is_said_of_it() {
    for [what, expected, script] in rows(STANDING) {
        let (flights, landings) = counts(script);
        assert_eq!(format!("{flights} {landings}"), expected, "{what}");
    }
}

#[test]
fn an_estimator_that_drifts_away_while_the_sensors_rest_begins_no_second_flight() {
    let drifts = |turns: f32| {
        counts(&format!(
            "0-10 landed=ground h=0 thr=0; 10-60 h=12 thr=0.5; 0 turns=0; 60 landed=landing thr=0.03 c=-2 turns={turns}; \
             60%30:0-10 landed=ground; 60-120 h=0..-120"
        ))
    };
    assert_eq!(drifts(0.0), (1, 1));
    assert_ne!(drifts(2.0), (1, 1), "what turns may fall");
}

#[test]
fn what_rotors_do_not_shake_and_the_barometer_never_saw_rise_does_not_fly_whatever_an_estimator_makes_of_it()
{
    let flights = |step_mps2: f32, rise_m: f32| {
        counts(&format!(
            "* shake={step_mps2} hpa=960 thr=0; 10 thr=0.5; 0-20 h=0; 20-30 h=0..-10; 30 h=-10; 20-100 hpa={}",
            960.0 - 0.12 * rise_m
        ))
        .0
    };
    assert_eq!(flights(0.03, 0.5), 0);
    assert_eq!(flights(0.03, 8.0), 1, "it rose: a simulator without noise");
    assert_eq!(flights(0.5, 0.5), 1, "it shakes: low over the ground");
}
