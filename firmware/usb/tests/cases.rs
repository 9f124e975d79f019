//! The thirteen cases of BOT 6.7, and invalid wrappers.

use hums_usb::transport::InvalidPacket;

use super::common::{Host, IN, OUT, content, read_10, wrapper};

const PASSED: u8 = 0;
const FAILED: u8 = 1;
const PHASE_ERROR: u8 = 2;
const READY: [u8; 6] = [0; 6];
const WRITE: [u8; 10] = [0x2A, 0, 0, 0, 0, 1, 0, 0, 2, 0];

fn outcome(expected: u32, flags: u8, block: &[u8]) -> (u8, usize, usize, u32) {
    let got = Host::new().run(expected, flags, block);
    (got.status, got.data.len(), got.taken, got.residue)
}

#[test]
fn the_host_expects_no_data() {
    // 1: the command has none either. 2: it has some. 3: it would take some, and is refused.
    assert_eq!(outcome(0, IN, &READY), (PASSED, 0, 0, 0));
    assert_eq!(outcome(0, OUT, &READY), (PASSED, 0, 0, 0));
    assert_eq!(outcome(0, IN, &read_10(5, 1)), (PHASE_ERROR, 0, 0, 0));
    assert_eq!(outcome(0, OUT, &WRITE), (FAILED, 0, 0, 0));
}

#[test]
fn the_host_expects_data() {
    // 4: the command has none.
    assert_eq!(outcome(512, IN, &READY), (PASSED, 0, 0, 512));
    assert_eq!(outcome(100, IN, &[0x12, 0, 0, 0, 36, 0]), (PASSED, 36, 0, 64));
    assert_eq!(outcome(4_096, IN, &read_10(5, 3)), (PASSED, 1_536, 0, 2_560));
    // 6: as much.
    assert_eq!(outcome(1_536, IN, &read_10(5, 3)), (PASSED, 1_536, 0, 0));
    // 7: more, also within a packet and within a block.
    for expected in [1, 63, 64, 100, 512, 1_000] {
        assert_eq!(outcome(expected, IN, &read_10(5, 3)), (PHASE_ERROR, expected as usize, 0, 0));
    }
    assert_eq!(outcome(1_024, IN, &WRITE), (FAILED, 0, 0, 1_024));
}

#[test]
fn the_host_sends_data() {
    // 9: the command takes none.
    assert_eq!(outcome(512, OUT, &READY), (PASSED, 0, 512, 512));
    // 10: it has data for the host.
    assert_eq!(outcome(1_000, OUT, &read_10(5, 1)), (PHASE_ERROR, 0, 1_000, 1_000));
    // 11, 12, 13: more than the command takes, as much, and less: refused.
    for sent in [2_048, 1_024, 512, 1, 64, 65] {
        assert_eq!(outcome(sent, OUT, &WRITE), (FAILED, 0, sent as usize, sent));
    }
}

#[test]
fn data_is_that_of_the_card() {
    let mut host = Host::new();
    for (first, count) in [(0, 1), (3, 4), (7, 9), (999, 1), (900, 100)] {
        let got = host.run(u32::from(count) * 512, IN, &read_10(first, count));
        let wanted: Vec<u8> = (first..first + u32::from(count)).flat_map(content).collect();
        assert!(got.status == PASSED && got.data == wanted, "{count} from {first}");
    }
}

#[test]
fn a_host_that_sends_less_than_announced_gets_its_status() {
    use hums_usb::server::Chunk;
    use hums_usb::transport::{Step, Transport};
    let mut host = Host::new();
    let mut memory = [[0; 512]; 3];
    let [chunk, ..] = &mut Chunk::of(&mut memory);
    let packet = wrapper(9, 1_000, OUT, &WRITE);
    let mut transport = Transport::begin(&packet, &mut host.disk).unwrap();
    transport.taken(64);
    assert_eq!(transport.step(&mut host.disk, chunk, &mut || true), Step::Take);
    transport.taken(3);
    assert_eq!(transport.step(&mut host.disk, chunk, &mut || true), Step::End);
}

#[test]
fn a_packet_that_is_no_wrapper_is_invalid() {
    let good = wrapper(1, 0, IN, &READY);
    let mut host = Host::new();
    assert!(host.packet(&good).is_ok());
    let change = |at: usize, to: u8| {
        let mut packet = good.clone();
        packet[at] = to;
        packet
    };
    let mut bad = vec![Vec::new(), good[..30].to_vec(), [&good[..], &[0]].concat(), vec![0; 64]];
    // Signature, reserved flags, other units, lengths of the command block.
    bad.extend([change(0, b'u'), change(3, 0), change(12, 1), change(12, 0xC0)]);
    bad.extend([change(13, 1), change(13, 0x10), change(14, 0), change(14, 17), change(14, 0xFF)]);
    for packet in bad {
        assert_eq!(host.packet(&packet), Err(InvalidPacket), "{packet:x?}");
    }
}
