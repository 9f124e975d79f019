//! A USB host at the board's plug: the serial port while it records, and card-reader mode from the command to the next record.

use std::collections::HashSet;

use anyhow::{Context as _, Result, ensure};
use hums_core::clock::Instant;
use hums_link::encode::{COMPONENT, Encoder, FRAME_BYTES_MAX};
use hums_link::frame::Frame;
use hums_link::framer::Framer;
use hums_link::mav_cmd::PREFLIGHT_REBOOT_SHUTDOWN;
use hums_link::messages;
use hums_link::packet::Packet;
use hums_link::signing::{Clock, Key, Seal};
use hums_sdcard::{Event, Kind, Model};
use hums_tests::chip::rig::{Rig, frame, heartbeat, heartbeat_in, set};
use hums_tests::chip::usb::{Bus, Disk, Serial, host};
use hums_tests::chip::{put, usart};
use stm32f405_model::machine::Board;
use stm32f405_model::otg::{Action, Reply};
use stm32f405_model::rcc::Cause;
use stm32f405_model::time::{MS, Ps, SECOND};

use super::{bench, budget, ready};

/// `base_mode` of a heartbeat.
const DISARMED: u8 = 0x51;
/// The same with `MAV_MODE_FLAG_SAFETY_ARMED`.
const ARMED: u8 = 0xD1;
/// Urgencies that serve the USB port, and their exceptions: 16 and the interrupt's number.
const URGENCIES: [(&str, u16); 3] = [("monitor", 16 + 20), ("downlink", 16 + 21), ("downlink", 16 + 67)];
/// In thousandths, with a bus full of control transfers and full rate at the autopilot's port.
const LOAD_MAX: u64 = 900;
/// In kB/s: an hour's log in a minute. The bus itself carries 1,216 (USB 2.0, table 5-9).
const READ_KBPS_MIN: u64 = 900;

fn on_the_ground() -> Rig {
    let (mut rig, _) = ready(Board::default());
    stand(&mut rig);
    rig
}

/// Three seconds of a disarmed vehicle.
fn stand(rig: &mut Rig) {
    for second in 0..3_u8 {
        let now = rig.machine.now();
        let beat = heartbeat(second);
        let end = rig.machine.send(usart(&rig.wired.autopilot), &beat, now, 921_600.0);
        rig.sent.push((end, beat));
        rig.run(now + SECOND, false).unwrap();
    }
}

fn command(rig: &mut Rig, action: f32) {
    let mut out = [0; FRAME_BYTES_MAX];
    let packet = messages::command_long(PREFLIGHT_REBOOT_SHUTDOWN, &[action], 1, COMPONENT);
    let frame = Encoder::of(255, 190).frame(&mut out, &packet).to_vec();
    let now = rig.machine.now();
    rig.machine.send(usart(&rig.wired.radio), &frame, now, 57_600.0);
}

fn reading() -> (Rig, usize) {
    let mut rig = on_the_ground();
    let resets = start_card_reader(&mut rig);
    (rig, resets)
}

/// Returns the number of resets so far.
fn start_card_reader(rig: &mut Rig) -> usize {
    let resets = rig.machine.resets.len();
    command(rig, 5.0);
    rig.run_for(3 * SECOND, false).unwrap();
    assert_eq!(
        rig.machine.resets[resets..].iter().map(|(_, cause)| *cause).collect::<Vec<_>>(),
        [Cause::Software]
    );
    resets + 1
}

/// The serial port during a record at full rate, then the card as a disk.
pub(super) fn serve(rig: &mut Rig) {
    use_host_while(rig, 20 * SECOND, true, |bus| {
        let serial = &mut Serial::attach(bus)?;
        hears_all(serial)?;
        asks(serial, 4_000.0)
    });
    rig.machine.unplug();
    // The line is still busy with the last frame.
    rig.run_for(10 * MS, false).unwrap();
    stand(rig);
    // Ends the log.
    start_card_reader(rig);
    let compared = rig.compared();
    assert_eq!((compared.missing, compared.wrong), (0, 0), "{compared:?}");
    read_card(rig);
}

/// The disk has the blocks of the card. Ejects it.
pub(super) fn read_card(rig: &mut Rig) {
    let card = rig.medium.content();
    use_host(rig, 60 * SECOND, move |bus| {
        let mut disk = Disk::attach(bus)?;
        for (at, block) in card {
            ensure!(disk.read(at, 1)?.data == block, "block {at} is another one");
        }
        disk.eject()
    });
}

fn use_host<T: Send + 'static>(
    rig: &mut Rig,
    limit: Ps,
    program: impl FnOnce(&mut Bus) -> Result<T> + Send + 'static,
) -> T {
    use_host_while(rig, limit, false, program)
}

/// `busy`: the autopilot's line is full of frames.
fn use_host_while<T: Send + 'static>(
    rig: &mut Rig,
    limit: Ps,
    busy: bool,
    program: impl FnOnce(&mut Bus) -> Result<T> + Send + 'static,
) -> T {
    let (host, thread) = host(program);
    let end = rig.machine.now() + limit;
    rig.machine.plug(host);
    while !thread.is_finished() {
        assert!(rig.machine.now() < end, "the host is not done");
        rig.run_for(10 * MS, busy).unwrap();
    }
    thread.join().unwrap().unwrap_or_else(|why| panic!("at {} ms: {why:#}", rig.machine.ms()))
}

#[test]
fn the_card_reader_shows_the_card_as_it_is_and_the_board_records_after_the_eject() {
    let (mut rig, resets) = reading();
    let (card, writes) = (rig.medium.content(), rig.medium.writes());
    let there = card.clone();
    let (kbps, blocks) = use_host(&mut rig, 60 * SECOND, move |bus| {
        let mut disk = Disk::attach(bus)?;
        ensure!(disk.command(&[0x12, 0, 0, 0, 36, 0], 36)?.data[8..12] == *b"HUMS");
        ensure!(disk.command(&[0; 6], 0)?.status == 0, "not ready");
        ensure!(disk.command(&[0x1A, 0, 0x3F, 0, 192, 0], 192)?.data == [3, 0, 0x80, 0]);
        let blocks = disk.blocks()?;
        for (first, count) in [(0, 1), (8_192, 1), (blocks - 1, 1), (8_192, 100), (16_000, 128)] {
            let done = disk.read(first, count)?;
            ensure!((done.status, done.residue) == (0, 0), "{first}: status {}", done.status);
            let block = |at| there.get(&at).copied().unwrap_or([0; 512]);
            let wanted: Vec<u8> = (first..first + u32::from(count)).flat_map(block).collect();
            ensure!(done.data == wanted, "{count} blocks from {first} are others");
        }
        for (at, block) in there {
            ensure!(disk.read(at, 1)?.data == block, "block {at} is another one");
        }
        let begun = disk.bus.now;
        // The length of Linux' commands.
        for first in [20_000, 20_240] {
            disk.read(first, 240)?;
        }
        let kbps = 480 * 512 * MS / (disk.bus.now - begun);
        let done = disk.write(&[0x2A, 0, 0, 0, 0, 0, 0, 0, 2, 0], &[0x55; 1_024])?;
        ensure!((done.status, done.residue, disk.sense()?) == (1, 1_024, (0x07, 0x27)), "{done:?}");
        ensure!(disk.command(&[0x5E; 10], 512)?.status == 1 && disk.sense()? == (0x05, 0x20));
        disk.eject()?;
        Ok((kbps, blocks))
    });
    println!("{kbps} kB/s");
    assert!(kbps >= READ_KBPS_MIN, "{kbps} kB/s");
    assert_eq!(blocks, hums_tests::chip::BLOCKS);
    assert!(rig.medium.content() == card && rig.medium.writes() == writes, "the card was written");

    let now = rig.machine.now();
    rig.run(now + 4 * SECOND, false).unwrap();
    assert_eq!(rig.machine.resets.len(), resets + 1, "{:?}", rig.machine.resets);
    rig.run(now + 5 * SECOND, true).unwrap();
    rig.run(now + 7 * SECOND, false).unwrap();
    let compared = rig.compared();
    assert_eq!((compared.missing, compared.wrong), (0, 0), "{compared:?}");
    let texts: Vec<_> = rig.sessions().into_iter().flat_map(|session| session.texts).collect();
    assert!(texts.iter().all(|text| !text.starts_with("fault")), "{texts:?}");
    assert!(rig.slot.violations().is_empty(), "{:?}", rig.slot.violations());
}

type Told = (u32, u8, u8, Vec<u8>);

fn told(bytes: &[u8]) -> Vec<Told> {
    let mut told = Vec::new();
    let mut framer = Framer::new();
    let mut take = |frame: Frame<'_>| {
        told.push((frame.id(), frame.sequence(), frame.component(), frame.payload().to_vec()));
    };
    framer.push(bytes, &mut take);
    framer.idle(&mut take);
    told
}

fn ours(told: &[Told]) -> impl Iterator<Item = &Told> {
    told.iter().filter(|(_, _, component, _)| *component == COMPONENT)
}

fn hears_all(serial: &mut Serial<'_>) -> Result<Vec<Told>> {
    let told = told(&serial.listen(2 * SECOND)?);
    let has = |id: u32, component: u8| told.iter().any(|one| (one.0, one.2) == (id, component));
    ensure!(has(0, 1) && has(0, COMPONENT) && has(30, 1) && has(251, COMPONENT), "{told:?}");
    let numbers: Vec<u8> = ours(&told).map(|one| one.1).collect();
    ensure!(
        numbers.windows(2).all(|two| two[1] == two[0].wrapping_add(1)),
        "frames are missing: {numbers:?}"
    );
    Ok(told)
}

fn answers_to(serial: &mut Serial<'_>, request: &[u8]) -> Result<Vec<Told>> {
    serial.send(request)?;
    Ok(told(&serial.listen(SECOND)?))
}

/// A parameter set, and logs listed.
fn asks(serial: &mut Serial<'_>, budget: f32) -> Result<()> {
    let answers = answers_to(serial, &set("GS_BUDGET", budget, 1))?;
    let is_value = |one: &&Told| one.0 == 22 && one.3.starts_with(&budget.to_le_bytes());
    ensure!(ours(&answers).any(|one| is_value(&one)), "no PARAM_VALUE: {answers:?}");
    let list = frame(117, &[0, 0, 0xFF, 0xFF, 1, COMPONENT], 128, 2);
    let answers = answers_to(serial, &list)?;
    ensure!(ours(&answers).any(|one| one.0 == 118), "no LOG_ENTRY: {answers:?}");
    Ok(())
}

#[test]
fn a_serial_port_serves_a_station_while_the_record_at_full_rate_stays_whole() {
    let mut rig = bench().settled(Board::default()).unwrap();
    let now = rig.machine.now();
    rig.run(now + SECOND, false).unwrap();
    rig.run(now + 3 * SECOND, true).unwrap();
    let resets = rig.machine.resets.len();
    use_host_while(&mut rig, 60 * SECOND, true, |bus| {
        let serial = &mut Serial::attach(bus)?;
        hears_all(serial)?;
        asks(serial, 4_000.0)?;
        let answers = answers_to(serial, &frame(21, &[1, COMPONENT], 159, 3))?;
        ensure!(ours(&answers).filter(|one| one.0 == 22).count() > 100, "{} parameters", answers.len());
        serial.bus.act(Action::Wait(3 * SECOND))?;
        serial.listen(100 * MS)?;
        serial.bus.act(Action::Wait(20 * MS))?;
        serial.listen(2 * SECOND)?;
        hears_all(serial)?;
        for kind in [0x00, 0x01, 0x02, 0x03, 0x20, 0x21, 0x22, 0x40, 0x41, 0x5F] {
            for request in [0, 2, 7, 11, 0x20, 0x21, 0x22, 0x23, 0xFD, 0xFE] {
                serial.bus.control(kind, request, 0xFFFF, 0xFFFF)?;
                serial.bus.control_in(kind, request, 0xFFFF, 0, 64)?;
            }
        }
        for length in [0, 1, 6, 7, 8, 64, 65] {
            serial.bus.setup(0x21, 0x20, 0, 0, length)?;
        }
        let mut state = 1_u64;
        any_actions(serial.bus, |below| next(&mut state) % below, 60)?;
        let serial = &mut Serial::attach(serial.bus)?;
        serial.send(&[0xFD; 500])?;
        hears_all(serial)?;
        asks(serial, 4_500.0)
    });
    rig.machine.unplug();
    rig.run_for(2 * SECOND, true).unwrap();
    use_host_while(&mut rig, 60 * SECOND, true, |bus| {
        let serial = &mut Serial::attach(bus)?;
        hears_all(serial)?;
        asks(serial, 5_000.0)
    });
    rig.run_for(2 * SECOND, false).unwrap();
    assert_eq!(rig.machine.resets.len(), resets, "{:?}", rig.machine.resets);
    let compared = rig.compared();
    assert_eq!((compared.missing, compared.wrong), (0, 0), "{compared:?}");
    let losses: Vec<_> = rig.sessions().into_iter().flat_map(|session| session.losses).collect();
    assert!(losses.is_empty(), "{losses:?}");
    for (name, exception) in URGENCIES {
        let (depth, limit) = (rig.machine.core.stack_depth(exception), budget("stack", name));
        println!("{name}, exception {exception}: {depth} bytes of stack");
        assert!(depth <= limit, "{name}: {depth} of {limit} bytes of stack");
    }
}

#[test]
#[ignore = "a busy bus for ten seconds: `cargo xtask prove chip`"]
fn ten_seconds_of_control_transfers_cost_no_frame() {
    let mut rig = bench().settled(Board::default()).unwrap();
    let now = rig.machine.now();
    rig.run(now + SECOND, false).unwrap();
    let resets = rig.machine.resets.len();
    let count = use_host_while(&mut rig, 60 * SECOND, true, |bus| {
        bus.enumerate()?;
        let (end, mut count) = (bus.now + 10 * SECOND, 0);
        while bus.now < end {
            ensure!(bus.control_in(0, 6, 0x0100, 0, 64)?.is_some(), "no descriptor");
            count += 1;
        }
        Ok(count)
    });
    rig.run_for(2 * SECOND, false).unwrap();
    assert_eq!(rig.machine.resets.len(), resets, "{:?}", rig.machine.resets);
    let (compared, session) = (rig.compared(), rig.sessions().pop().unwrap());
    assert_eq!((compared.missing, compared.wrong), (0, 0), "{compared:?}");
    assert!(session.losses.is_empty(), "{:?}", session.losses);
    let load = session.loads.iter().max().unwrap();
    println!("{count} transfers, load of {load} in a thousand: {:?}", session.loads);
    assert!(count > 10_000 && *load < LOAD_MAX, "{count} transfers, load {load}");
}

fn one_of(answers: &[Told], id: u32, is_it: impl Fn(&[u8]) -> bool) -> Result<()> {
    ensure!(ours(answers).any(|one| one.0 == id && is_it(&one.3)), "no answer of kind {id}: {answers:?}");
    Ok(())
}

/// The first bytes of a log, by `LOG_REQUEST_DATA` and `LOG_DATA`.
fn log_data(serial: &mut Serial<'_>, number: u8, bytes: usize) -> Result<Vec<u8>> {
    let mut log = Vec::new();
    while log.len() < bytes {
        let ([o0, o1, o2, o3], count) =
            ((log.len() as u32).to_le_bytes(), (bytes - log.len()).min(900) as u32);
        let [c0, c1, ..] = count.to_le_bytes();
        let request = frame(119, &[o0, o1, o2, o3, c0, c1, 0, 0, number, 0, 1, COMPONENT], 116, 2);
        let answers = answers_to(serial, &request)?;
        let before = log.len();
        for one in ours(&answers).filter(|one| one.0 == 120) {
            let mut data = one.3.clone();
            data.resize(97, 0);
            let at = u32::from_le_bytes([data[0], data[1], data[2], data[3]]) as usize;
            if at == log.len() {
                log.extend_from_slice(&data[7..7 + usize::from(data[6])]);
            }
        }
        ensure!(log.len() > before, "no data from {before} on: {answers:?}");
    }
    Ok(log)
}

#[test]
#[ignore = "a minute: `cargo xtask prove chip`"]
fn a_station_at_the_plug_downloads_a_log_and_sets_a_key() {
    const SIGNED: &str = "correct-horse-battery";
    let mut rig = bench().rig(Board::default());
    put(&rig.medium, &[(b"PARAMS  TXT", b"SIGN_PORT 1\nGS_SIGN 2\n")]);
    rig.run(2 * SECOND, false).unwrap();
    rig.run(5 * SECOND, true).unwrap();
    rig.machine.power_off();
    rig.run(5 * SECOND + 100 * MS, false).unwrap();
    rig.machine.power_on();
    rig.run(6 * SECOND, false).unwrap();
    for _ in 0..4 {
        heartbeats(&mut rig, DISARMED);
    }
    let blocks = use_host(&mut rig, 120 * SECOND, |bus| {
        let serial = &mut Serial::attach(bus)?;
        ensure!(!serial.listen(SECOND)?.is_empty(), "it says nothing");
        let list = answers_to(serial, &frame(117, &[0, 0, 0xFF, 0xFF, 1, COMPONENT], 128, 1))?;
        // LOG_ENTRY: time, bytes, number.
        let entry = |one: &Told| Some((u32::from_le_bytes(*one.3.get(4..)?.first_chunk()?), one.3[8]));
        let entries = ours(&list).filter(|one| one.0 == 118).filter_map(entry);
        let (bytes, number) = entries.max().context("no LOG_ENTRY")?;
        let log = log_data(serial, number, (bytes as usize).min(8 * 512))?;
        Ok(log.as_chunks::<512>().0.to_vec())
    });
    let card: HashSet<[u8; 512]> = rig.medium.content().into_values().collect();
    let wrong = blocks.iter().filter(|block| !card.contains(*block)).count();
    assert!(wrong == 0 && blocks.len() == 8, "{wrong} of {} blocks are not the card's", blocks.len());

    use_host(&mut rig, 60 * SECOND, |bus| {
        let serial = &mut Serial::attach(bus)?;
        let is = |value: f32| move |payload: &[u8]| payload.starts_with(&value.to_le_bytes());
        let key = Key::of_passphrase(SIGNED);
        let setup = Packet::new(256).u64(0, 1_000_000_000).u8(8, 1).u8(9, COMPONENT).bytes(10, &key.0);
        let (mut out, mut station) = ([0; FRAME_BYTES_MAX], Encoder::of(255, 190));
        serial.send(station.frame(&mut out, &setup))?;
        serial.listen(SECOND)?;
        one_of(&answers_to(serial, &set("GS_BUDGET", 4_000.0, 3))?, 22, is(2_000.0))?;
        let mut seal = Seal::new(key, 0, Clock::default(), 1_000_000_000);
        let wanted =
            Packet::new(23).f32(0, 4_000.0).u8(4, 1).u8(5, COMPONENT).text(6, 16, "GS_BUDGET").u8(22, 9);
        let signed = station.frame_signed(&mut out, &wanted, Instant::ZERO, &mut seal).to_vec();
        serial.send(&signed)?;
        let answers = serial.listen(SECOND)?;
        one_of(&told(&answers), 22, is(4_000.0))?;
        let (mut framer, mut unsigned) = (Framer::new(), 0);
        framer.push(&answers, &mut |frame: Frame<'_>| {
            unsigned += u32::from(frame.component() == COMPONENT && !frame.signed());
        });
        ensure!(unsigned == 0, "{unsigned} frames of the box are not signed");
        // The same again is a replay.
        serial.send(&signed)?;
        one_of(&answers_to(serial, &set("GS_BUDGET", 3_000.0, 4))?, 22, is(4_000.0))
    });
    let key = Key::of_passphrase(SIGNED).0;
    let content = rig.medium.content();
    assert!(
        !content.values().any(|block| block.windows(32).any(|bytes| bytes == key)),
        "the key is on the card"
    );
}

#[test]
fn no_cable_and_no_other_command_stops_a_record() {
    let mut rig = on_the_ground();
    let resets = rig.machine.resets.len();
    use_host(&mut rig, 10 * SECOND, |bus| {
        Serial::attach(bus)?;
        Ok(())
    });
    command(&mut rig, 1.0);
    rig.run_for(SECOND, false).unwrap();
    let armed = heartbeat_in(ARMED, 9);
    let now = rig.machine.now();
    let end = rig.machine.send(usart(&rig.wired.autopilot), &armed, now, 921_600.0);
    rig.sent.push((end, armed));
    rig.run(now + 100 * MS, false).unwrap();
    command(&mut rig, 5.0);
    rig.run(now + 3 * SECOND, false).unwrap();
    assert_eq!(rig.machine.resets.len(), resets, "{:?}", rig.machine.resets);
    let compared = rig.compared();
    assert_eq!((compared.missing, compared.wrong), (0, 0), "{compared:?}");
}

type Host = fn(&mut Rig);

/// The hosts follow each other at one board.
#[test]
fn whatever_a_host_does_the_next_one_gets_the_card() {
    let (mut rig, resets) = reading();
    let (card, writes) = (rig.medium.content(), rig.medium.writes());
    let hosts: [(&str, Host); 5] = [
        ("misbehaves", misbehaves_and_gets_the_card),
        ("finds the card pulled", finds_the_card_pulled_and_back),
        ("gives up transfers", gives_up_control_transfers),
        ("configures anew", configures_anew_without_a_reset),
        ("does anything", does_anything_and_attaches),
    ];
    for (name, host) in hosts {
        println!("a host that {name}");
        host(&mut rig);
        rig.machine.unplug();
        rig.run_for(500 * MS, false).unwrap();
        assert_eq!(rig.machine.resets.len(), resets, "{name}: {:?}", rig.machine.resets);
        let is_same = rig.medium.content() == card && rig.medium.writes() == writes;
        assert!(is_same, "{name}: the card was written");
    }
}

fn misbehaves_and_gets_the_card(rig: &mut Rig) {
    let first = rig.medium.get(0).to_vec();
    use_host(rig, 60 * SECOND, move |bus| {
        let mut disk = Disk::attach(bus)?;
        let (to, from) = disk.endpoints;
        for endpoint in [1, 2, 3, 4, 15, 0x81, 0x83, 0x84, 0x8F, 0xFF] {
            for request in [1, 3] {
                disk.bus.control(2, request, 0, endpoint)?;
            }
            disk.bus.control_in(2, 0, 0, endpoint, 2)?;
        }
        disk.bus.clear_halt(to)?;
        disk.bus.clear_halt(0x80 | from)?;
        ensure!(disk.read(0, 1)?.data == first, "halts of the host");
        // No command wrapper: both endpoints halt, and stay so until the class is reset (BOT, 6.6.1).
        for garbage in [&[0x55; 31][..], b"USBC", &[0; 64]] {
            disk.bus.write(to, garbage)?;
            disk.bus.act(Action::Wait(10 * MS))?;
            ensure!(disk.bus.read(from, 13)?.is_none(), "no halt");
            disk.bus.control(2, 1, 0, u16::from(0x80 | from))?;
            ensure!(disk.bus.read(from, 13)?.is_none(), "the halt was cleared without a reset");
            ensure!(disk.bus.control(0x21, 0xFF, 0, 0)?, "no reset of the class");
            disk.bus.clear_halt(to)?;
            disk.bus.clear_halt(0x80 | from)?;
            ensure!(disk.read(0, 1)?.data == first, "after garbage");
        }
        for kind in [0x00, 0x01, 0x02, 0x03, 0x20, 0x21, 0x22, 0x40, 0x41, 0x5F] {
            for request in [0, 2, 7, 9, 11, 0x22, 0xFD, 0xFE] {
                disk.bus.control(kind, request, 0xFFFF, 0xFFFF)?;
                disk.bus.control_in(kind, request, 0xFFFF, 0xFFFF, 64)?;
            }
        }
        ensure!(disk.read(0, 1)?.data == first, "after unknown requests");
        let mut wrapper = b"USBC\x01\0\0\0\0\x80\0\0\x80\0\x0A\x28\0\0\0\0\0\0\0\x40".to_vec();
        wrapper.resize(31, 0);
        disk.bus.write(to, &wrapper)?;
        disk.bus.read(from, 640)?;
        ensure!(disk.bus.control(0x21, 0xFF, 0, 0)?, "no reset of the class");
        disk.bus.clear_halt(to)?;
        disk.bus.clear_halt(0x80 | from)?;
        ensure!(disk.read(0, 1)?.data == first, "after a reset within the data");
        disk.bus.write(to, &wrapper)?;
        disk.bus.read(from, 640)?;
        let mut disk = Disk::attach(disk.bus)?;
        ensure!(disk.read(0, 1)?.data == first, "after a reset of the bus");
        Ok(())
    });
}

fn finds_the_card_pulled_and_back(rig: &mut Rig) {
    let slot = rig.slot.clone();
    slot.event(Event::Pull);
    use_host(rig, 60 * SECOND, |bus| {
        let mut disk = Disk::attach(bus)?;
        let done = disk.read(0, 8)?;
        ensure!((done.status, done.data.len(), disk.sense()?.0) == (1, 0, 0x02), "{done:?}");
        Ok(())
    });
    slot.event(Event::Insert(Model::new(Kind::Sdhc, rig.medium.clone())));
    let first = rig.medium.get(0).to_vec();
    use_host(rig, 60 * SECOND, move |bus| {
        let mut disk = Disk::attach(bus)?;
        ensure!(disk.read(0, 1)?.status == 1 && disk.sense()? == (0x06, 0x28), "the change is not told");
        ensure!(disk.read(0, 1)?.data == first, "the card is back");
        Ok(())
    });
}

fn answers(bus: &mut Bus) -> Result<()> {
    let begun = bus.now;
    let device = bus.control_in(0, 6, 0x0100, 0, 64)?;
    ensure!(device.is_some_and(|device| device.len() == 18), "no descriptor");
    ensure!(bus.now - begun < 100 * MS, "after {} ms", (bus.now - begun) / MS);
    Ok(())
}

/// Each ends with the host's next one or a reset.
fn gives_up_control_transfers(rig: &mut Rig) {
    let first = rig.medium.get(0).to_vec();
    use_host(rig, 120 * SECOND, move |bus| {
        type Unfinished = fn(&mut Bus) -> Result<()>;
        let unfinished: [(&str, Unfinished); 6] = [
            ("no data", |bus| bus.setup(0x80, 6, 0x0100, 0, 64)),
            ("no status", |bus| {
                bus.setup(0x80, 6, 0x0100, 0, 64)?;
                bus.read(0, 64).map(drop)
            }),
            ("no data to the device", |bus| bus.setup(0x21, 0xFF, 0, 0, 8)),
            ("data but no status", |bus| {
                bus.setup(0x21, 0xFF, 0, 0, 8)?;
                bus.write(0, &[0x55; 8]).map(drop)
            }),
            ("half of the data", |bus| {
                bus.setup(0x21, 0xFF, 0, 0, 128)?;
                bus.write(0, &[0x55; 64]).map(drop)
            }),
            ("no status of a request without data", |bus| bus.setup(0, 9, 1, 0, 0)),
        ];
        for (name, begin) in unfinished {
            println!("{name}");
            let bus = &mut *Disk::attach(bus)?.bus;
            begin(bus)?;
            answers(bus)?;
            begin(bus)?;
            bus.act(Action::Wait(20 * MS))?;
            answers(bus)?;
            begin(bus)?;
            bus.act(Action::Wait(20 * MS))?;
            bus.reset()?;
            answers(bus)?;
            begin(bus)?;
            bus.act(Action::Wait(2 * SECOND))?;
            answers(bus)?;
            begin(bus)?;
            ensure!(Disk::attach(bus)?.read(0, 1)?.data == first, "{name}");
        }
        Ok(())
    });
}

fn configures_anew_without_a_reset(rig: &mut Rig) {
    let first = rig.medium.get(0).to_vec();
    use_host(rig, 60 * SECOND, move |bus| {
        let mut disk = Disk::attach(bus)?;
        let (to, from) = disk.endpoints;
        let mut wrapper = b"USBC\x01\0\0\0\0\x80\0\0\x80\0\x0A\x28\0\0\0\0\0\0\0\x40".to_vec();
        wrapper.resize(31, 0);
        // SET_CONFIGURATION, SET_INTERFACE.
        for (kind, request, value) in [(0, 9, 1), (1, 11, 0)] {
            disk.command(&[0; 6], 0)?;
            disk.bus.control(2, 3, 0, to.into())?;
            disk.bus.control(2, 3, 0, u16::from(0x80 | from))?;
            disk.bus.configure(kind, request, value)?;
            ensure!(disk.read(0, 1)?.data == first, "after halts of the host");
            disk.bus.write(to, &[0x55; 31])?;
            disk.bus.act(Action::Wait(10 * MS))?;
            disk.bus.configure(kind, request, value)?;
            ensure!(disk.read(0, 1)?.data == first, "after halts of the disk");
            disk.bus.write(to, &wrapper)?;
            disk.bus.read(from, 640)?;
            disk.bus.configure(kind, request, value)?;
            ensure!(disk.read(0, 1)?.data == first, "after a part of a command");
        }
        disk.bus.control(0, 9, 0, 0)?;
        disk.bus.control(0x21, 0xFF, 0, 0)?;
        let packet = Action::Out(disk.bus.address, to, false, vec![0; 31]);
        ensure!(disk.bus.act(packet)? == Reply::Nothing, "an endpoint without a configuration");
        disk.bus.configure(0, 9, 1)?;
        ensure!(disk.read(0, 1)?.data == first, "configured again");
        Ok(())
    });
}

/// Two seconds of heartbeats.
fn heartbeats(rig: &mut Rig, base_mode: u8) {
    for second in 0..2 {
        let now = rig.machine.now();
        let beat = heartbeat_in(base_mode, 100 + second);
        rig.machine.send(usart(&rig.wired.autopilot), &beat, now, 921_600.0);
        rig.run(now + SECOND, false).unwrap();
    }
}

#[test]
fn an_arming_ends_the_card_reader_and_the_board_records() {
    let (mut rig, resets) = reading();
    use_host(&mut rig, 60 * SECOND, |bus| Disk::attach(bus)?.blocks());
    let (changes, now) = (rig.led.len(), rig.machine.now());
    rig.run(now + 2 * SECOND, false).unwrap();
    assert!(rig.led.len() == changes && rig.led.last().is_some_and(|(_, lit)| *lit), "the LED is not lit");
    let before = rig.sessions().len();
    heartbeats(&mut rig, DISARMED);
    assert_eq!(rig.machine.resets.len(), resets, "{:?}", rig.machine.resets);
    let (now, sent) = (rig.machine.now(), rig.sent.len());
    heartbeats(&mut rig, ARMED);
    let armed = rig.machine.now();
    rig.run(armed + 3 * SECOND, true).unwrap();
    rig.run(armed + 5 * SECOND, false).unwrap();
    assert_eq!(rig.machine.resets.len(), resets + 1, "{:?}", rig.machine.resets);
    assert_eq!(rig.machine.resets[resets].1, Cause::Software);
    assert!(rig.machine.resets[resets].0 < now + 1_100 * MS, "late: {:?}", rig.machine.resets);
    assert_eq!(rig.sessions().len(), before + 1);
    let frames = rig.sessions().pop().unwrap().frames;
    assert_eq!(frames.len(), rig.sent.len() - sent, "the board recorded late");
}

#[test]
fn a_fault_of_the_card_reader_is_recorded_as_one_of_it() {
    /// `udf #0`
    const UNDEFINED: [u8; 2] = [0x00, 0xDE];
    let (mut rig, resets) = reading();
    let (host, thread) = host(Bus::enumerate);
    rig.machine.plug(host);
    let address = rig.replace("OTG_FS", &UNDEFINED, false).unwrap();
    drop(thread);
    assert_eq!(rig.machine.resets.len(), resets + 1, "{:?}", rig.machine.resets);
    rig.machine.unplug();
    let now = rig.machine.now();
    rig.run(now + 4 * SECOND, true).unwrap();
    rig.run(now + 6 * SECOND, false).unwrap();
    let texts = rig.sessions().pop().unwrap().texts;
    let fault = format!("fault: processor fault in interrupt at pc {address:08x}");
    assert!(texts.contains(&fault), "{texts:?}");
    let note = texts.iter().find(|text| text.contains("restart at"));
    let note = note.unwrap_or_else(|| panic!("no note in {texts:?}"));
    assert!(note.starts_with("card reader: restart at ") && note.ends_with("last messages:"), "{note}");
}

/// Constants: Knuth, MMIX.
fn next(state: &mut u64) -> u64 {
    *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    *state >> 33
}

fn any_actions(bus: &mut Bus, mut random: impl FnMut(u64) -> u64, count: u32) -> Result<()> {
    for _ in 0..count {
        let address = [0, bus.address][random(2) as usize];
        let endpoint = random(3) as u8;
        let action = match random(10) {
            0 => Action::Reset,
            1 => Action::Sleep((1 + random(20)) * MS),
            2 => Action::Wait(random(400) * MS),
            3 | 4 => Action::Out(address, endpoint, random(2) == 1, vec![0x55; random(65) as usize]),
            5 | 6 => Action::In(address, endpoint),
            _ => {
                // Kind, request, value: descriptors, addresses, configurations, interfaces, halts, the class, anything.
                let kinds = [0x80, 0x00, 0x01, 0x02, 0x82, 0x21, 0xA1, random(256) as u8];
                let requests = [6, 5, 9, 11, 3, 1, 0xFF, 0xFE, 0, random(256) as u8];
                let values = [0x00, 0x01, 0x0100, 0x0200, 0x0301, random(1 << 16) as u16];
                let [v0, v1] = values[random(6) as usize].to_le_bytes();
                let (index, length) =
                    ([0, 1, 0x81, 0x80][random(4) as usize], [0, 8, 64, 255][random(4) as usize]);
                let (kind, request) = (kinds[random(8) as usize], requests[random(10) as usize]);
                Action::Setup(address, [kind, request, v0, v1, index, 0, length, 0])
            }
        };
        bus.act(action)?;
    }
    Ok(())
}

fn does_anything_and_attaches(rig: &mut Rig) {
    let first = rig.medium.get(0).to_vec();
    use_host(rig, 600 * SECOND, move |bus| {
        for seed in 1..=4_u64 {
            println!("seed {seed}");
            let mut state = seed;
            any_actions(bus, |below| next(&mut state) % below, 60)?;
            let begun = bus.now;
            ensure!(Disk::attach(bus)?.read(0, 1)?.data == first, "seed {seed}");
            ensure!(bus.now - begun < 2 * SECOND, "seed {seed}: after {} ms", (bus.now - begun) / MS);
        }
        Ok(())
    });
}

#[test]
#[ignore = "ten minutes in the model's time: `cargo xtask prove chip`"]
fn ten_minutes_after_the_cable_was_pulled_the_board_records_again() {
    let (mut rig, resets) = reading();
    use_host(&mut rig, 60 * SECOND, |bus| Disk::attach(bus)?.blocks());
    rig.machine.unplug();
    let now = rig.machine.now();
    rig.run(now + 590 * SECOND, false).unwrap();
    assert_eq!(rig.machine.resets.len(), resets, "{:?}", rig.machine.resets);
    rig.run(now + 610 * SECOND, false).unwrap();
    assert_eq!(rig.machine.resets.len(), resets + 1, "{:?}", rig.machine.resets);
}
