//! Answers to any packets: rules of the bus, blocks that exist, data that the card gave.

use proptest::prelude::*;

use super::common::{BLOCKS, Host, IN, OUT, content, wrapper};

fn command() -> impl Strategy<Value = Vec<u8>> {
    let code = prop_oneof![
        Just(0x28_u8),
        Just(0x88),
        Just(0xA8),
        Just(0x12),
        Just(0x25),
        Just(0x9E),
        Just(0x1A),
        Just(0x2A),
        any::<u8>()
    ];
    let byte = prop_oneof![Just(0_u8), Just(0xFF), Just(1), Just(3), any::<u8>()];
    (code, prop::collection::vec(byte, 0..16)).prop_map(|(code, rest)| {
        let mut block = vec![code];
        block.extend(rest.into_iter().take(15));
        block
    })
}

fn expected() -> impl Strategy<Value = u32> {
    // A test holds what it gets: at most 32 KiB.
    prop_oneof![Just(0), Just(512), Just(1), Just(64), 0..32_768_u32]
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, cases: 2_000, ..ProptestConfig::default() })]

    #[test]
    fn a_hostile_host_gets_only_the_card(
        requests in prop::collection::vec((command(), expected(), any::<bool>(), 0..8_u8), 1..30),
    ) {
        let mut host = Host::new();
        for (tag, (block, expected, to_host, event)) in (0_u32..).zip(requests) {
            match event {
                0 => host.card.gone.set(!host.card.gone.get()),
                1 => host.card.bad.set(Some(u32::from(block[0]) * 4)),
                2 => host.card.bad.set(None),
                3 => host.change_card(),
                _ => {}
            }
            let flags = if to_host { IN } else { OUT };
            let got = host.packet(&wrapper(tag, expected, flags, &block)).expect("a valid wrapper");
            prop_assert!(got.status <= 2);
            if matches!(block[0], 0x28 | 0x88 | 0xA8) {
                let at = if block[0] == 0x88 { 6 } else { 2 };
                let first = block.get(at..at + 4).and_then(|word| word.first_chunk().copied());
                let first = first.map_or(0, u32::from_be_bytes);
                for (data, number) in got.data.chunks(512).zip(first..) {
                    prop_assert!(data == &content(number + (host.card.edition.get() << 16))[..data.len()], "stale or foreign data");
                }
            }
            prop_assert!(host.card.end.get() <= BLOCKS);
        }
    }

    #[test]
    fn any_packet_is_a_wrapper_or_invalid(packet in prop::collection::vec(any::<u8>(), 0..64)) {
        let mut host = Host::new();
        let mut packet = packet;
        if packet.len() > 11 {
            packet[10] &= 1;
            packet[11] = 0;
        }
        let _ = host.packet(&packet);
        if packet.len() >= 4 {
            packet[..4].copy_from_slice(b"USBC");
            packet.resize(31, 0);
            packet[13] = 0;
            packet[12] &= 0x80;
            packet[14] &= 0x1F;
            let _ = host.packet(&packet);
        }
    }
}
