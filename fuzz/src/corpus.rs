//! The inputs of the corpus that are generated.

use hums_blackbox::SECTOR_BYTES;
use hums_recorder::LogName;

use crate::{dataflash, page, ulog};

/// The corpus: target, name and bytes of each input.
pub fn inputs() -> Vec<(&'static str, &'static str, Vec<u8>)> {
    let entries = entries();
    let log = page::log(&entries);
    let with = |first: u8, bytes: &[u8]| [&[first], bytes].concat();
    let stream = log.get(19 + 26..SECTOR_BYTES).unwrap_or_default();
    let mut newer = log.clone();
    newer[0] = 0x49;
    vec![
        ("card", "segments", segments()),
        ("card", "deep", deep()),
        ("card", "entries", vec![8, 0, 0, 255].into_iter().chain([0x41; 255]).collect()),
        ("dataflash", "binary", with(0, &dataflash::log())),
        ("dataflash", "text", with(1, &dataflash::text())),
        ("decoder", "log", with(200, &with(0, stream))),
        ("find", "log", with(0, &log)),
        ("find", "salvaged", with(3, &log)),
        ("find", "card", with(0x1d, &log)),
        ("find", "newer", with(0, &newer)),
        ("framer", "frames", with(20, &raw())),
        ("page", "entries", entries),
        ("page", "markup", markup()),
        ("reader", "log", with(1, &log)),
        ("recording", "raw", raw()),
        ("recording", "tlog", tlog()),
        ("recording", "log", log),
        (
            "round_trip",
            "pieces",
            (0..60_u8).flat_map(|at| [9, at, at, 0, 0, 0, 0, 2, 3, 81, 4, at % 7]).collect(),
        ),
        ("ulog", "topics", ulog::log()),
    ]
}

/// HEARTBEAT of an `ArduPilot` quadrotor with its checksum, as MAVLink 1.
const HEARTBEAT: [u8; 17] = [0xfe, 9, 0x4e, 1, 1, 0, 0, 0, 0, 0, 2, 3, 0x51, 4, 3, 0x1c, 0x7f];

fn raw() -> Vec<u8> {
    [&HEARTBEAT.repeat(12)[..], b"boot\n\xfd\xfe", &HEARTBEAT.repeat(2)].concat()
}

fn tlog() -> Vec<u8> {
    let times = (0..20_u64).map(|second| 1_700_000_000_000_000 + second * 1_000_000);
    times.flat_map(|time| [&time.to_be_bytes()[..], &HEARTBEAT].concat()).collect()
}

fn entries() -> Vec<u8> {
    let mut out = Vec::new();
    let heartbeat = [0, 0, 0, 0, 2, 3, 81, 4, 3];
    for second in 0..4_u8 {
        push(&mut out, 0, 250, 0, &heartbeat);
        for id in [1, 24, 30, 33, 65, 74, 109, 147, 193, 230, 241, 253, 11_030] {
            let content: Vec<u8> = (0..40).map(|at: u8| at.wrapping_mul(37).wrapping_add(second)).collect();
            push(&mut out, 0, 50, id, &content);
        }
    }
    out.extend_from_slice(&[7, 1, 4, 0, 5]);
    out.extend_from_slice(b"noted");
    out
}

fn markup() -> Vec<u8> {
    let mut out = Vec::new();
    push(&mut out, 0, 10, 0, &[0, 0, 0, 0, 2, 3, 81, 4, 3]);
    for text in ["</script><script>alert(1)</script>", "<!--", "\u{2028}&amp;\u{2029}\"\\", "=1+1"] {
        let content = [&[4][..], text.as_bytes()].concat();
        push(&mut out, 0, 20, 253, &content);
        out.extend_from_slice(&[7, 1, 4, 0, text.len() as u8]);
        out.extend_from_slice(text.as_bytes());
    }
    out
}

fn push(out: &mut Vec<u8>, kind: u8, step: u8, id: u32, content: &[u8]) {
    let number = hums_dialect::messages().iter().position(|message| message.id == id).unwrap_or_default();
    let [low, high] = (number as u16).to_le_bytes();
    out.extend_from_slice(&[kind, step, low, high, content.len() as u8]);
    out.extend_from_slice(content);
}

fn entry(place: u8, number: u16, name: &[u8; 11], attributes: u8, cluster: u16, size: u32) -> Vec<u8> {
    let [low, high] = (number * 32).to_le_bytes();
    let mut out = vec![place, low, high, 32];
    out.extend_from_slice(name);
    out.push(attributes);
    out.extend_from_slice(&[0; 14]);
    out.extend_from_slice(&cluster.to_le_bytes());
    out.extend_from_slice(&size.to_le_bytes());
    out
}

fn chain(first: u16, next: &[u32]) -> Vec<u8> {
    let [low, high] = (first * 4).to_le_bytes();
    let mut out = vec![3, low, high, 4 * next.len() as u8];
    out.extend(next.iter().flat_map(|cluster| cluster.to_le_bytes()));
    out
}

fn segments() -> Vec<u8> {
    let name = |session, segment| LogName { session, segment }.short();
    [
        entry(8, 0, &name(1, 0), 0x20, 3, 1_000),
        entry(8, 1, &name(1, 1), 0x20, 5, 512),
        entry(8, 2, b"NOTES   TXT", 0x20, 6, 40),
        chain(3, &[4, 0x0fff_ffff, 0x0fff_ffff, 0x0fff_ffff]),
    ]
    .concat()
}

/// Directories in directories.
fn deep() -> Vec<u8> {
    let mut out = Vec::new();
    for depth in 0..10_u8 {
        out.extend(entry(8 + depth, 0, b"FOLDER     ", 0x10, u16::from(depth) + 3, 0));
        out.extend(entry(
            8 + depth,
            1,
            &LogName { session: u32::from(depth) + 1, segment: 0 }.short(),
            0x20,
            0,
            0,
        ));
    }
    out.extend(chain(3, &[0x0fff_ffff; 10]));
    out
}
