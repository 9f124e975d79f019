//! The card is valid and holds the flight up to the cut.

use hums_tests::damage::Random;
use hums_tests::fat;
use hums_tests::flights::{Manifest, own};
use hums_tests::program::{Decoded, Machine, Recording};

/// A sample; the campaign cuts each kind of write (data, FAT, directory), whole and torn.
const CUTS: usize = 12;

/// A log's first second, or frames in memory.
const LOST_MAX: u64 = 100;

const FLIGHT: &str = "px4_hil_quad_low.tlog";

#[test]
fn after_a_cut_at_any_write_the_card_is_in_order_and_gives_the_flight_up_to_there() {
    let manifest = Manifest::own();
    let path = own(FLIGHT);
    let data = std::fs::read(&path).unwrap();
    let input = manifest.frames_of(&path, &data);
    let whole = Recording::make(Machine::Sim, &path, &["--card-size", "40"]);
    let writes = whole.number("blocks_written");
    assert!(writes > 200, "{writes} writes of a flight of four minutes");

    let mut random = Random::new(21);
    let mut frames_of_cuts = Vec::new();
    for cut in 0..CUTS {
        let torn = if cut % 2 == 0 { "" } else { ":torn" };
        let at = format!("{}{torn}", 1 + random.below(writes));
        let flags = ["--card-size", "40", "--cut-after-writes", &at];
        let recording = Recording::attempt(Machine::Sim, &path, &flags).expect_code(&[0, 3]);
        fat::assert_clean(&recording.image());
        // Exit code 1: no log before its first sector.
        let decoded = Decoded::of(&recording.image(), &[0, 1, 3]);
        let output = decoded.frames(&manifest.seeds);
        let prefix =
            output.len() <= input.len() && output.iter().zip(&input).all(|(a, b)| a.bytes == b.bytes);
        assert!(prefix, "cut at {at}: {} frames that are no beginning of the flight", output.len());
        assert_eq!(output.len() as u64, recording.number("frames_logged"), "cut at {at}: counted as logged");
        assert!(recording.number("frames_lost") < LOST_MAX, "cut at {at}: more than what was in memory");
        frames_of_cuts.push(output.len());
    }
    // Empty cards would pass otherwise.
    let most = frames_of_cuts.iter().max().copied().unwrap_or(0);
    assert!(most > input.len() / 2, "the most that any cut left is {most} of {}", input.len());
}
