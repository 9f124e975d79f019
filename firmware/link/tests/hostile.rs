//! No input may panic, overflow, or make an unknown vehicle look healthy.

use hums_core::Monitor;
use hums_core::clock;
use hums_core::component::{COMPONENTS_MAX, Label};
use hums_core::health::Level;
use hums_core::lifetime::{ITEM_BYTES_MAX, ItemKey, Room};
use hums_core::parameters::{Params, TABLE};
use hums_core::status::{LinkReading, RecorderStatus};
use hums_core::time::BootMs;
use hums_core::usage::FIGURE_FIRST;
use hums_link::sequence::Sequences;
use hums_link::{Framer, observe};
use proptest::prelude::*;

const USED: &[u32] = &[
    0, 1, 2, 24, 26, 27, 29, 30, 32, 33, 46, 65, 74, 77, 105, 109, 116, 124, 125, 129, 137, 143, 147, 148,
    193, 225, 226, 230, 241, 245, 253, 290, 291, 339, 373, 441, 11_030, 11_039,
];

fn frame(id: u32, sequence: u8, payload: &[u8]) -> Vec<u8> {
    let [id0, id1, id2, _] = id.to_le_bytes();
    let mut bytes = vec![0xfd, payload.len() as u8, 0, 0, sequence, 1, 1, id0, id1, id2];
    bytes.extend_from_slice(payload);
    let extra = hums_dialect::message(id).map_or(0, |message| message.crc_extra);
    let crc = bytes[1..].iter().copied().chain([extra]).fold(0xffff_u16, |mut crc, byte| {
        crc ^= u16::from(byte);
        for _ in 0..8 {
            crc = if crc & 1 == 1 { (crc >> 1) ^ 0x8408 } else { crc >> 1 };
        }
        crc
    });
    bytes.extend_from_slice(&crc.to_le_bytes());
    bytes
}

fn heartbeat(armed: bool, autopilot: u8) -> Vec<u8> {
    vec![0, 0, 0, 0, 2, autopilot, if armed { 0x81 } else { 1 }, 4, 3]
}

fn payload() -> impl Strategy<Value = Vec<u8>> {
    let repeated =
        |pattern: [u8; 4]| (0..=64_usize).prop_map(move |words| pattern.repeat(words)[..].to_vec());
    prop_oneof![
        prop::collection::vec(any::<u8>(), 0..=255),
        repeated(f32::NAN.to_le_bytes()),
        repeated(f32::INFINITY.to_le_bytes()),
        repeated(f32::NEG_INFINITY.to_le_bytes()),
        repeated(f32::MAX.to_le_bytes()),
        repeated(f32::MIN_POSITIVE.to_le_bytes()),
        repeated([0xff; 4]),
        repeated([0; 4]),
        repeated([0, 0x80, 0, 0x80]),
        repeated([0xff, 0x7f, 0xff, 0x7f]),
    ]
    .prop_map(|mut payload| {
        payload.truncate(255);
        payload
    })
}

fn params(settings: &[(usize, f32)]) -> Params {
    let mut params = Params::defaults();
    for (index, place) in settings {
        let spec = &TABLE[*index];
        // Whole numbers select; a value that rounding moves out of its range is refused.
        let value = (spec.min + place * (spec.max - spec.min)).round();
        let _ = params.set(spec.name, value);
    }
    params
}

fn look(monitor: &mut Monitor, now: BootMs) {
    let sane = |counter: u8, value: f64| {
        let sign = counter >= FIGURE_FIRST || value >= 0.0;
        assert!(value.is_finite() && sign, "counter {counter} is {value}");
    };
    monitor.for_each_counter(sane);
    monitor.lifetime().totals.for_each(sane);
    while monitor.take_happening().is_some() {}
    let _ = monitor.take_request();
    for exceedance in monitor.exceedances().iter(now) {
        assert!(exceedance.lifetime.warnings >= exceedance.session.warnings);
    }
    for place in 0..COMPONENTS_MAX {
        let used = monitor.component_used_percent(place);
        assert!(used.is_none_or(|percent| percent >= 0.0), "{used:?}");
    }
    let mut replaced = false;
    while let Some(key) = monitor.save_due(now, Room::Enough) {
        let mut item = [0; ITEM_BYTES_MAX];
        let length = monitor.encode_item(key, &mut item);
        let again = Monitor::new(Params::defaults()).restore(key, &item[..length]);
        assert_eq!(again, Ok(()), "{key:?} does not read back");
        monitor.saved(key);
        if !replaced {
            replaced = true;
            monitor.replace_component(usize::from(key.number() % 8), Label::new("new"));
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    #[test]
    fn no_order_gap_repeat_or_value_of_any_message_panics_or_spoils_the_figures(
        messages in prop::collection::vec((0..USED.len(), payload(), 0..5_000_u64, any::<u8>()), 1..80),
        armed in any::<bool>(),
        autopilot in prop::sample::select(vec![3_u8, 12, 0]),
        settings in prop::collection::vec((0..TABLE.len(), 0.0..=1.0_f32), 0..30),
        items in prop::collection::vec((any::<u8>(), prop::collection::vec(any::<u8>(), 0..600)), 0..6),
    ) {
        let mut framer = Framer::new();
        let mut sequences = Sequences::new();
        let mut monitor = Monitor::new(params(&settings));
        for (number, stored) in &items {
            if let Some(key) = ItemKey::from_number(number % 25) {
                let mut stored = stored.clone();
                if let Some(version) = stored.first_mut() {
                    *version = (*version).max(1);
                }
                let _ = monitor.restore(key, &stored);
            }
        }
        let mut now_ms = 0;
        let first = frame(0, 0, &heartbeat(armed, autopilot));
        for bytes in std::iter::once((first, 0)).chain(
            messages.iter().map(|(at, payload, gap_ms, sequence)| (frame(USED[*at], *sequence, payload), *gap_ms)),
        ) {
            now_ms += bytes.1;
            let now = BootMs::from_millis(now_ms);
            let heard = clock::Instant::from_millis(now_ms);
            framer.push(&bytes.0, &mut |frame| {
                sequences.frame(heard, &frame);
                if let Some((source, observation)) = observe(&frame) {
                    monitor.observe(now, source, &observation);
                }
            });
            let link = sequences.reading(heard, monitor.vehicle().source);
            monitor.tick(now, &link, &RecorderStatus::default(), &mut |finding| {
                assert!(finding.level != finding.previous || finding.because.is_empty(), "{finding:?}");
            });
            look(&mut monitor, now);
        }
    }

    #[test]
    fn a_vehicle_of_which_only_the_heartbeat_is_known_is_never_healthy(
        beats in 1..50_u8,
        unknown in prop::sample::select(vec![1_u32, 147, 24, 193, 230, 241, 30, 290, 291]),
    ) {
        let mut monitor = Monitor::new(Params::defaults());
        let mut framer = Framer::new();
        for beat in 0..beats {
            let now = BootMs::from_millis(u64::from(beat) * 500);
            let mut bytes = frame(0, beat, &heartbeat(beat % 2 == 0, 3));
            bytes.extend(frame(unknown, beat, &[0xff; 100]));
            framer.push(&bytes, &mut |frame| {
                if let Some((source, observation)) = observe(&frame) {
                    monitor.observe(now, source, &observation);
                }
            });
            monitor.tick(now, &LinkReading::default(), &RecorderStatus::default(), &mut |_| {});
            assert_ne!(monitor.health().overall(), Level::Ok);
        }
    }
}
