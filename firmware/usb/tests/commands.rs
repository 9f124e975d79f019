//! Commands of Windows, macOS and Linux.

use hums_recorder::CardDevice as _;
use hums_usb::scsi::{Sense, WRITING};

use super::common::{BLOCKS, Host, IN, OUT, SERIAL, content, read_10};

#[test]
fn a_host_reads_identity_size_and_protection() {
    let mut host = Host::new();
    let inquiry = host.run(36, IN, &[0x12, 0, 0, 0, 36, 0]).data;
    // A removable disk, 31 more bytes.
    assert_eq!((&inquiry[..5], &inquiry[8..16]), (&[0, 0x80, 4, 2, 31][..], &b"HUMS    "[..]));
    assert_eq!(inquiry.len(), 36);
    let capacity = host.run(8, IN, &[0x25, 0, 0, 0, 0, 0, 0, 0, 0, 0]).data;
    assert_eq!(capacity, [&(BLOCKS - 1).to_be_bytes()[..], &[0, 0, 2, 0]].concat());
    let mut long = [0; 16];
    (long[0], long[1], long[13]) = (0x9E, 0x10, 32);
    let capacity = host.run(32, IN, &long).data;
    let wanted = [&u64::from(BLOCKS - 1).to_be_bytes()[..], &[0, 0, 2, 0], &[0; 20]].concat();
    assert_eq!(capacity, wanted);
    let formats = host.run(252, IN, &[0x23, 0, 0, 0, 0, 0, 0, 0, 252, 0]).data;
    assert_eq!(formats, [&[0, 0, 0, 8][..], &BLOCKS.to_be_bytes(), &[2, 0, 2, 0]].concat());
    for page in [0x08, 0x1C, 0x3F] {
        assert_eq!(host.run(192, IN, &[0x1A, 0, page, 0, 192, 0]).data, [3, 0, 0x80, 0]);
        let got = host.run(192, IN, &[0x5A, 0, page, 0, 0, 0, 0, 0, 192, 0]);
        assert_eq!(got.data, [0, 6, 0, 0x80, 0, 0, 0, 0]);
    }
    assert_eq!(
        host.run(16, IN, &[0xA0, 0, 0, 0, 0, 0, 0, 0, 0, 16, 0, 0]).data[..8],
        [0, 0, 0, 8, 0, 0, 0, 0]
    );
}

#[test]
fn pages_of_the_identity_are_as_long_as_they_say() {
    let mut host = Host::new();
    let mut page = |number| host.run(255, IN, &[0x12, 1, number, 0, 255, 0]).data;
    assert_eq!(page(0x00), [0, 0, 0, 3, 0x00, 0x80, 0x83]);
    assert_eq!(page(0x80)[4..], SERIAL);
    for number in [0x00, 0x80, 0x83] {
        let data = page(number);
        assert_eq!((data[1], usize::from(data[3])), (number, data.len() - 4));
    }
    let data = page(0x83);
    assert_eq!(usize::from(data[7]), data.len() - 8);
    assert_eq!(data[16..], SERIAL);
    assert_eq!(host.refused(255, IN, &[0x12, 1, 0xB0, 0, 255, 0]), Sense::INVALID_FIELD);
    assert_eq!(host.refused(255, IN, &[0x12, 0, 0x80, 0, 255, 0]), Sense::INVALID_FIELD);
}

#[test]
fn an_allocation_length_cuts_the_answer() {
    let mut host = Host::new();
    for length in 0..=36 {
        assert_eq!(host.run(64, IN, &[0x12, 0, 0, 0, length, 0]).data.len(), usize::from(length));
    }
    assert_eq!(host.run(64, IN, &[0x12, 0, 0, 1, 0, 0]).data.len(), 36);
}

#[test]
fn every_write_is_refused_as_protected() {
    let mut host = Host::new();
    for code in WRITING {
        let mut block = [0; 16];
        (block[0], block[8]) = (code, 1);
        for (expected, flags) in [(0, IN), (512, OUT), (512, IN)] {
            assert_eq!(host.refused(expected, flags, &block), Sense::PROTECTED, "{code:#x}");
        }
    }
    assert_eq!(host.run(0, IN, &read_10(0, 0)).status, 0, "the disk goes on");
}

#[test]
fn an_unknown_command_is_answered() {
    let mut host = Host::new();
    let known = [0x00, 0x03, 0x12, 0x1A, 0x1B, 0x1E, 0x23, 0x25, 0x28, 0x35, 0x5A, 0x88, 0x91, 0xA0, 0xA8];
    for code in (0..=255).filter(|code| !known.contains(code) && !WRITING.contains(code)) {
        let mut block = [0; 16];
        block[0] = code;
        assert_eq!(host.refused(96, IN, &block), Sense::UNKNOWN_COMMAND, "{code:#x}");
        assert_eq!(host.sense(), Sense::default(), "sense is given once");
    }
}

#[test]
fn a_command_block_that_is_too_short_is_refused() {
    let mut host = Host::new();
    for (code, bytes) in [(0x12, 6), (0x28, 10), (0x5A, 10), (0x88, 16), (0xA8, 12)] {
        for length in 1..bytes {
            let mut block = [0; 16];
            block[0] = code;
            assert_eq!(host.refused(0, IN, &block[..length]), Sense::INVALID_FIELD, "{code:#x} {length}");
        }
    }
}

#[test]
fn no_block_beyond_the_card_is_read() {
    let mut host = Host::new();
    let long = |first: u64, count: u32| {
        [&[0x88, 0][..], &first.to_be_bytes(), &count.to_be_bytes(), &[0, 0]].concat()
    };
    let middle = |first: u32, count: u32| {
        [&[0xA8, 0][..], &first.to_be_bytes(), &count.to_be_bytes(), &[0, 0]].concat()
    };
    let beyond = [
        read_10(BLOCKS, 1).to_vec(),
        read_10(BLOCKS - 1, 2).to_vec(),
        read_10(u32::MAX, 1).to_vec(),
        read_10(u32::MAX, u16::MAX).to_vec(),
        read_10(BLOCKS + 1, 0).to_vec(),
        middle(0, u32::MAX),
        middle(u32::MAX, u32::MAX),
        long(1 << 32, 1),
        long(u64::MAX, 1),
        long(u64::MAX, u32::MAX),
        long(BLOCKS.into(), 1),
    ];
    for block in beyond {
        assert_eq!(host.refused(512, IN, &block), Sense::OUT_OF_RANGE, "{block:x?}");
    }
    assert_eq!(host.card.end.get(), 0);
    for block in [middle(998, 2), long(998, 2)] {
        assert_eq!(host.run(1_024, IN, &block).data, [content(998), content(999)].concat());
    }
}

#[test]
fn a_read_error_is_a_medium_error_and_no_data() {
    let mut host = Host::new();
    for bad in 10..20 {
        host.card.bad.set(Some(bad));
        let got = host.run(5_120, IN, &read_10(10, 10));
        let good: Vec<u8> = (10..bad).flat_map(content).collect();
        assert_eq!(got.status, 1);
        assert!(got.data == good, "block {bad}");
        assert_eq!(host.sense(), Sense::UNREADABLE);
    }
    host.card.bad.set(Some(0));
    assert_eq!(host.refused(0, IN, &[0; 6]), Sense::UNREADABLE);
    host.card.bad.set(None);
    assert_eq!(host.run(512, IN, &read_10(10, 1)).data, content(10));
}

#[test]
fn the_next_blocks_are_read_while_the_host_thinks_and_count_for_a_moment() {
    let mut host = Host::new();
    let reads = |host: &mut Host, first, wanted: u32| {
        let before = host.card.reads.get();
        let got = host.run(4 * 512, IN, &read_10(first, 4));
        let edition = host.card.edition.get() << 16;
        let good: Vec<u8> = (first..first + 4).flat_map(|number| content(number + edition)).collect();
        assert!(got.status == 0 && got.data == good, "{first}");
        assert_eq!(host.card.reads.get() - before, wanted, "{first}");
    };
    // Four of the command, and four behind.
    reads(&mut host, 100, 8);
    reads(&mut host, 104, 4);
    reads(&mut host, 108, 4);
    // Elsewhere, after another command, with another card.
    reads(&mut host, 200, 8);
    host.run(36, IN, &[0x12, 0, 0, 0, 36, 0]);
    reads(&mut host, 204, 8);
    host.change_card();
    reads(&mut host, 208, 8);
    reads(&mut host, 994, 6);
    reads(&mut host, 992, 8);
    reads(&mut host, 996, 0);
}

#[test]
fn a_block_that_is_unreadable_ahead_fails_no_other_command() {
    let mut host = Host::new();
    host.card.bad.set(Some(15));
    assert_eq!(host.run(1_024, IN, &read_10(10, 2)).data, [content(10), content(11)].concat());
    let got = host.run(1_536, IN, &read_10(12, 3));
    assert!(got.status == 0 && got.data == [content(12), content(13), content(14)].concat());
    assert_eq!(host.sense(), Sense::default());
    assert_eq!(host.refused(512, IN, &read_10(15, 1)), Sense::UNREADABLE);
    host.card.gone.set(true);
    assert_eq!(host.refused(512, IN, &read_10(16, 1)), Sense::NO_MEDIUM);
}

#[test]
fn a_pulled_card_is_missed_and_its_return_reported_once() {
    let mut host = Host::new();
    let ready = [0; 6];
    assert_eq!(host.run(0, IN, &ready).status, 0);
    host.card.gone.set(true);
    for block in [&ready[..], &read_10(0, 1), &[0x25, 0, 0, 0, 0, 0, 0, 0, 0, 0], &ready] {
        assert_eq!(host.refused(0, IN, block), Sense::NO_MEDIUM);
    }
    assert!(host.card.resets.get() > 0, "any card is accepted again");
    assert_eq!(host.run(36, IN, &[0x12, 0, 0, 0, 36, 0]).status, 0, "the disk itself is there");
    host.card.gone.set(false);
    assert_eq!(host.refused(512, IN, &read_10(0, 1)), Sense::CHANGED);
    assert_eq!(host.run(512, IN, &read_10(0, 1)).data, content(0));
}

#[test]
fn an_eject_ends_the_disk() {
    let mut host = Host::new();
    // Start, stop without eject, load, allow removal: no eject.
    for block in [[0x1B, 0, 0, 0, 1, 0], [0x1B, 0, 0, 0, 0, 0], [0x1B, 0, 0, 0, 3, 0], [0x1E, 0, 0, 0, 0, 0]]
    {
        assert_eq!(host.run(0, IN, &block).status, 0);
        assert!(!host.disk.is_ejected());
    }
    assert_eq!(host.refused(0, IN, &[0x1E, 0, 0, 0, 1, 0]), Sense::INVALID_FIELD);
    assert_eq!(host.run(0, IN, &[0x1B, 0, 0, 0, 2, 0]).status, 0);
    assert!(host.disk.is_ejected());
    assert_eq!(host.refused(512, IN, &read_10(0, 1)), Sense::NO_MEDIUM);
    assert!(host.card.read(&mut [[0; 512]], 0).is_ok());
}
