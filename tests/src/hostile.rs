//! Well-formed inputs, far larger inside than outside.

use std::fs::{self, File};
use std::io::{BufWriter, Seek as _, SeekFrom, Write};
use std::path::{Path, PathBuf};

use flate2::Compression;
use flate2::write::GzEncoder;
use hums::card::ReadOnlyImage;
use hums_blackbox::parity::Sum;
use hums_blackbox::{Header, SECTOR_BYTES, Sector};
use hums_dialect::crc;
use hums_link::encode::{Encoder, FRAME_BYTES_MAX};
use hums_link::packet::Packet;
use hums_recorder::layout::Layout;

use crate::program::{hums, hums_with};

/// HEARTBEAT of an `ArduPilot` quadrotor, MAVLink 1.
const HEARTBEAT: [u8; 17] = [0xfe, 9, 0x4e, 1, 1, 0, 0, 0, 0, 0, 2, 3, 0x51, 4, 3, 0x1c, 0x7f];
/// 65,536 entries of 32 bytes.
const DIRECTORY_BLOCKS: u32 = 4_096;
const CLUSTER: u32 = 60_000;

fn packed(dir: &Path, name: &str, raw: &[u8]) -> PathBuf {
    let (recording, log) = (dir.join(format!("{name}.raw")), dir.join(format!("{name}.hum")));
    fs::write(&recording, raw).unwrap();
    if log.exists() {
        fs::remove_file(&log).unwrap();
    }
    hums_with("decode --format hum {} -o {}", &[&recording, &log]).expect_code(&[0]);
    fs::remove_file(recording).unwrap();
    log
}

/// `count` sectors, each a session's beginning.
pub fn starts(dir: &Path, count: u32) -> PathBuf {
    let first = fs::read(heartbeats(dir, 100)).unwrap();
    let mut sector = Sector::from_bytes(*first.first_chunk::<SECTOR_BYTES>().unwrap());
    long(dir, "starts.hum", |file| {
        for session in 0..count {
            sector.seal(1_000_000 + session);
            file.write_all(sector.bytes()).unwrap();
        }
    })
}

/// Ten heartbeats, then `count` parity sectors.
pub fn parity(dir: &Path, count: u32) -> PathBuf {
    let log = heartbeats(dir, 10);
    let session = Header::read(fs::read(&log).unwrap().first_chunk().unwrap()).unwrap().session;
    let path = dir.join("parity.hum");
    fs::rename(log, &path).unwrap();
    let mut file = BufWriter::new(File::options().append(true).open(&path).unwrap());
    for last in 0..count {
        let mut block = [0; SECTOR_BYTES];
        Sum::ALL[last as usize % 2].seal(&mut block, session, last / 2);
        file.write_all(&block).unwrap();
    }
    file.flush().unwrap();
    path
}

/// One heartbeat `count` times, raw.
pub fn raw_heartbeats(dir: &Path, count: usize) -> PathBuf {
    let path = dir.join("heartbeats.raw");
    fs::write(&path, HEARTBEAT.repeat(count)).unwrap();
    path
}

/// One heartbeat `count` times: 200 bytes are 30,000 frames.
pub fn heartbeats(dir: &Path, count: usize) -> PathBuf {
    packed(dir, "heartbeats", &HEARTBEAT.repeat(count))
}

fn messages(dir: &Path, name: &str, count: u32, packet: impl Fn(u32) -> Packet) -> PathBuf {
    let mut encoder = Encoder::of(1, 1);
    let mut raw = HEARTBEAT.to_vec();
    for number in 0..count {
        let mut buffer = [0; FRAME_BYTES_MAX];
        raw.extend_from_slice(encoder.frame(&mut buffer, &packet(number)));
    }
    packed(dir, name, &raw)
}

/// Different texts only.
pub fn texts(dir: &Path, count: u32) -> PathBuf {
    messages(dir, "texts", count, |number| {
        Packet::new(253).u8(0, 4).text(1, 50, &format!("the same words over and over, {number:09}"))
    })
}

/// Parameters only, each with its own name.
pub fn parameters(dir: &Path, count: u32) -> PathBuf {
    messages(dir, "parameters", count, |number| {
        Packet::new(22).f32(0, 1.0).u16(4, 60_000).text(8, 16, &format!("P{number:09}")).u8(24, 9)
    })
}

/// Unknown messages, each with its own id.
pub fn unknown_ids(dir: &Path, count: u32) -> PathBuf {
    // One would not make it a recording.
    let mut raw = HEARTBEAT.repeat(10);
    for number in 0..count {
        let [low, middle, high, _] = (70_000 + number).to_le_bytes();
        let mut frame = vec![0xfd, 1, 0, 0, number as u8, 1, 1, low, middle, high, 1];
        // Valid with the seed 0: a frame.
        let crc = crc::step(crc::update(crc::START, &frame[1..]), 0);
        frame.extend_from_slice(&crc.to_le_bytes());
        raw.extend_from_slice(&frame);
    }
    packed(dir, "unknown", &raw)
}

/// Vehicles that send each quantity of twelve motors twenty times a second.
pub fn fleet(dir: &Path, vehicles: u8, seconds: u64) -> PathBuf {
    let (mut log, log_path) = (Vec::new(), dir.join("fleet.tlog"));
    let mut encoders: Vec<Encoder> = (1..=vehicles).map(|system| Encoder::of(system, 1)).collect();
    for tick in 0..seconds * 20 {
        let value = (tick % 100) as f32;
        let heartbeat = Packet::new(0).u8(4, 2).u8(5, 3).u8(6, 0x51).u8(7, 4).u8(8, 3);
        let vibration = Packet::new(241).f32(8, value).f32(12, value).f32(16, value);
        let motors = [11_030, 11_031, 11_032].map(|id| {
            // Two bytes for each of four: voltage, current, total, speed, count; then four temperatures.
            let numbers =
                (0..20).fold(Packet::new(id), |packet, place| packet.u16(2 * place, 100 + tick as u16 % 100));
            (40..44).fold(numbers, |packet, place| packet.u8(place, 30))
        });
        for encoder in &mut encoders {
            for packet in [&heartbeat, &vibration].into_iter().chain(&motors) {
                let mut buffer = [0; FRAME_BYTES_MAX];
                log.extend_from_slice(&(1_700_000_000_000_000 + tick * 50_000).to_be_bytes());
                log.extend_from_slice(encoder.frame(&mut buffer, packet));
            }
        }
    }
    fs::write(&log_path, log).unwrap();
    log_path
}

fn ulog_begin(log: &mut dyn Write) {
    log.write_all(b"ULog\x01\x12\x35\x01").unwrap();
    log.write_all(&1_000_000_u64.to_le_bytes()).unwrap();
}

fn ulog_message(log: &mut dyn Write, kind: u8, body: &[&[u8]]) {
    let body = body.concat();
    let head = u16::try_from(body.len()).unwrap().to_le_bytes();
    log.write_all(&[&head[..], &[kind], &body].concat()).unwrap();
}

/// Two joined sets of topics, more than PX4 has: 2,000 tables of 30 columns.
pub fn wide_ulog(dir: &Path) -> PathBuf {
    const TOPICS: u16 = 1_000;
    const FIELDS: usize = 30;
    long(dir, "wide.ulg", |log| {
        for part in 0..2 {
            ulog_begin(log);
            ulog_message(log, b'B', &[&[0; 40]]);
            let name = |topic: u16| format!("topic_{part}{topic:04}");
            for topic in 0..TOPICS {
                let field = |field| format!("uint8_t f_{part}{topic:04}_{field};");
                let fields = (0..FIELDS).map(field).collect::<Vec<_>>().concat();
                ulog_message(log, b'F', &[format!("{}:uint64_t timestamp;{fields}", name(topic)).as_bytes()]);
            }
            for topic in 0..TOPICS {
                ulog_message(log, b'A', &[&[0], &topic.to_le_bytes(), name(topic).as_bytes()]);
            }
            for row in 0..20_u64 {
                for topic in 0..TOPICS {
                    let at = 1_000_000 + row * 100_000 + u64::from(topic);
                    ulog_message(log, b'D', &[&topic.to_le_bytes(), &at.to_le_bytes(), &[row as u8; FIELDS]]);
                }
            }
        }
    })
}

/// Topics with an array of bytes, each a column.
pub fn long_arrays(dir: &Path) -> PathBuf {
    long(dir, "arrays.ulg", |log| {
        ulog_begin(log);
        for (topic, length) in [(0_u16, 1_000_usize), (1, 30_000)] {
            let (id, name) = (topic.to_le_bytes(), format!("array_{topic}"));
            let format = format!("{name}:uint64_t timestamp;uint8_t[{length}] data;");
            ulog_message(log, b'F', &[format.as_bytes()]);
            ulog_message(log, b'A', &[&[0], &id, name.as_bytes()]);
            for row in 0..200_u64 {
                let at = 1_000_000 + row * 1_000;
                ulog_message(log, b'D', &[&id, &at.to_le_bytes(), &vec![7; length]]);
            }
        }
    })
}

/// 45 MB and 38 s: an attitude and a long text 20 times a second.
pub fn long_ulog(dir: &Path) -> PathBuf {
    let mut text = vec![0; 60_000];
    text[..30_000].fill(b'x');
    long(dir, "long.ulg", |log| {
        ulog_begin(log);
        ulog_message(log, b'F', &[b"vehicle_attitude:uint64_t timestamp;float[4] q;"]);
        ulog_message(log, b'F', &[b"words:uint64_t timestamp;char[60000] text;"]);
        ulog_message(log, b'A', &[&[0, 0, 0], b"vehicle_attitude"]);
        ulog_message(log, b'A', &[&[0, 1, 0], b"words"]);
        for row in 0..750_u64 {
            let at = (1_000_000 + row * 50_000).to_le_bytes();
            let level = [1_f32, 0.0, 0.0, row as f32 * 1e-6].map(f32::to_le_bytes).concat();
            ulog_message(log, b'D', &[&[0, 0], &at, &level]);
            ulog_message(log, b'D', &[&[1, 0], &at, &text]);
        }
    })
}

/// 45 MB and seven minutes: an attitude and 25 messages of three texts 20 times a second.
pub fn long_dataflash(dir: &Path) -> PathBuf {
    let mut texts = [0; 3 * 64];
    texts.chunks_mut(64).for_each(|text| text[..12].fill(b'x'));
    long(dir, "long.bin", |log| {
        let mut write = |bytes: &[u8]| log.write_all(bytes).unwrap();
        write(&dataflash_format(128, 89, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns"));
        write(&dataflash_format(130, 3 + 8 + 12, "ATT", "Qfff", "TimeUS,Roll,Pitch,Yaw"));
        write(&dataflash_format(131, 3 + 8 + texts.len(), "WORD", "QZZZ", "TimeUS,A,B,C"));
        for row in 0..8_800_u64 {
            let at = 1_000_000 + row * 50_000;
            let level = [0.0, 0.0, row as f32 * 1e-3].map(f32::to_le_bytes).concat();
            write(&[&[0xa3, 0x95, 130], &at.to_le_bytes()[..], &level].concat());
            for part in 0..25 {
                write(&[&[0xa3, 0x95, 131], &(at + part * 2_000).to_le_bytes()[..], &texts].concat());
            }
        }
    })
}

fn long(dir: &Path, name: &str, write: impl FnOnce(&mut dyn Write)) -> PathBuf {
    let path = dir.join(name);
    let mut file = BufWriter::new(File::create(&path).unwrap());
    write(&mut file);
    file.flush().unwrap();
    path
}

/// `.gz` that expands 900-fold to so many MiB: heartbeats, zeros, heartbeats.
pub fn expanding(dir: &Path, mib: u64) -> PathBuf {
    let path = dir.join("expanding.raw.gz");
    let mut to = GzEncoder::new(File::create(&path).unwrap(), Compression::default());
    to.write_all(&HEARTBEAT.repeat(1_000)).unwrap();
    for _ in 0..mib {
        to.write_all(&vec![0; 1 << 20]).unwrap();
    }
    to.write_all(&HEARTBEAT.repeat(1_000)).unwrap();
    to.finish().unwrap();
    path
}

/// A line of so many MiB.
pub fn long_line(dir: &Path, mib: u64) -> PathBuf {
    long(dir, "line.log", |log| {
        log.write_all(b"FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n").unwrap();
        log.write_all(b"FMT, 129, 23, ATT, Qff, TimeUS,Roll,Pitch\n").unwrap();
        for second in 1..20 {
            writeln!(log, "ATT, {}, 1.5, 2.0", second * 1_000_000).unwrap();
        }
        log.write_all(b"ATT, 30000000, 1.5, ").unwrap();
        for _ in 0..mib {
            log.write_all(&vec![b'1'; 1 << 20]).unwrap();
        }
    })
}

fn dataflash_format(kind: u8, bytes: usize, name: &str, format: &str, columns: &str) -> Vec<u8> {
    let mut message = vec![0xa3, 0x95, 128, kind, u8::try_from(bytes).unwrap()];
    for (text, room) in [(name, 4), (format, 16), (columns, 64)] {
        let mut text = text.as_bytes().to_vec();
        text.resize(room, 0);
        message.extend_from_slice(&text);
    }
    message
}

/// 64 messages, each defined sixteen times: the maximum number of tables.
pub fn wide_dataflash(dir: &Path) -> PathBuf {
    const COLUMNS: usize = 14;
    let mut log = dataflash_format(128, 89, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns");
    for version in 0..16_u8 {
        for kind in 0..64_u8 {
            let letter = char::from(b'A' + version);
            let column = |column| format!(",{letter}{column:02}");
            let columns = (0..COLUMNS).map(column).collect::<Vec<_>>().concat();
            let bytes = 3 + 8 + COLUMNS;
            let types = format!("Q{}", "B".repeat(COLUMNS));
            log.extend_from_slice(&dataflash_format(
                130 + kind,
                bytes,
                &format!("T{kind:02}"),
                &types,
                &format!("TimeUS{columns}"),
            ));
        }
        for row in 0..60_u64 {
            for kind in 0..64_u8 {
                let at = 1_000_000 + (u64::from(version) * 60 + row) * 10_000;
                log.extend_from_slice(&[0xa3, 0x95, 130 + kind]);
                log.extend_from_slice(&at.to_le_bytes());
                log.extend_from_slice(&[row as u8; COLUMNS]);
            }
        }
    }
    let path = dir.join("wide.bin");
    fs::write(&path, log).unwrap();
    path
}

/// 64 MiB, a short session.
fn card(dir: &Path, name: &str) -> (PathBuf, File, Layout) {
    let (recording, image) = (dir.join(format!("{name}.raw")), dir.join(format!("{name}.img")));
    fs::write(&recording, HEARTBEAT.repeat(100)).unwrap();
    let sim = ["sim".as_ref(), recording.as_os_str(), "--card-size".as_ref(), "64".as_ref()];
    hums(sim.into_iter().chain(["--sd".as_ref(), image.as_os_str()])).expect_code(&[0]);
    let file = File::options().read(true).write(true).open(&image).unwrap();
    let layout = Layout::read(&ReadOnlyImage::new(file.try_clone().unwrap()).unwrap()).unwrap();
    assert_eq!(layout.cluster_blocks, 1, "a cluster is a block");
    (image, file, layout)
}

fn write_at(file: &mut File, block: u32, bytes: &[u8]) {
    file.seek(SeekFrom::Start(u64::from(block) * 512)).unwrap();
    file.write_all(bytes).unwrap();
}

fn entry(name: &[u8; 11], attributes: u8, cluster: u32, size: u32) -> [u8; 32] {
    let mut entry = [0; 32];
    entry[..11].copy_from_slice(name);
    entry[11] = attributes;
    let [low, second, third, high] = cluster.to_le_bytes();
    (entry[20], entry[21], entry[26], entry[27]) = (third, high, low, second);
    entry[28..].copy_from_slice(&size.to_le_bytes());
    entry
}

/// Directories full of segments: empty ones, or ones without a cluster.
pub fn directories(dir: &Path, count: u32, bogus: bool) -> PathBuf {
    let (image, mut file, layout) = card(dir, if bogus { "bogus" } else { "empty" });
    let root: Vec<u8> = (0..count)
        .flat_map(|number| {
            let mut name = *b"FOLDER     ";
            name[7] = b'A' + number as u8;
            entry(&name, 0x10, CLUSTER + number * DIRECTORY_BLOCKS, 0)
        })
        .collect();
    assert!(root.len() <= 512);
    let mut first = root;
    first.resize(512, 0);
    write_at(&mut file, layout.data_start, &first);
    let (cluster, size) = if bogus { (1, 512) } else { (0, 0) };
    let block = entry(b"00001_00HUM", 0x20, cluster, size).repeat(16);
    let clusters = count * DIRECTORY_BLOCKS;
    write_at(&mut file, layout.data_start + CLUSTER - 2, &block.repeat(clusters as usize));
    let chain: Vec<u8> = (1..=clusters)
        .flat_map(|number| {
            let next = if number % DIRECTORY_BLOCKS == 0 { 0x0fff_ffff } else { CLUSTER + number };
            next.to_le_bytes()
        })
        .collect();
    file.seek(SeekFrom::Start(u64::from(layout.fat_start) * 512 + u64::from(CLUSTER) * 4)).unwrap();
    file.write_all(&chain).unwrap();
    image
}

/// `count` sectors, each of its own session.
pub fn sessions(dir: &Path, count: u32) -> PathBuf {
    let (image, mut file, layout) = card(dir, "sessions");
    let mut sectors = Vec::new();
    for session in 0..count {
        let mut bytes = [0; SECTOR_BYTES];
        bytes[..2].copy_from_slice(&[0x48, 0xb3]);
        let mut sector = Sector::from_bytes(bytes);
        sector.seal(1_000_000 + session);
        sectors.extend_from_slice(sector.bytes());
    }
    write_at(&mut file, layout.data_start + CLUSTER, &sectors);
    image
}
