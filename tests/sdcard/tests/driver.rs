//! The driver against the card, command by command, in bounded time and without violations on the bus.

use hums_core::clock::Span;
use hums_recorder::spi::{BUSY_MAX, SERVICE_MAX, SpiCard, SpiError};
use hums_recorder::{BLOCK_BYTES, Block, CardDevice as _, Trouble};
use hums_sdcard::{Event, Fault, Kind, MS, Medium, Model, Plan, SimPort, Slot};

const MIB: u32 = 2_048;

fn card(kind: Kind) -> Model {
    Model::new(kind, Medium::new(64 * MIB))
}

fn block(seed: u32) -> Block {
    std::array::from_fn(|index| (seed as usize * 31 + index * 7) as u8)
}

fn blocks(count: u32) -> Vec<Block> {
    (0..count).map(block).collect()
}

struct Bench {
    slot: Slot,
    driver: SpiCard<SimPort>,
}

impl Bench {
    fn new(model: impl Into<Option<Model>>) -> Self {
        let slot = Slot::new(model.into());
        let driver = SpiCard::new(slot.port());
        Self { slot, driver }
    }

    fn write(&self, at: u32, blocks: &[Block]) -> Result<(), SpiError> {
        self.driver.write(blocks, at)
    }

    fn read(&self, at: u32) -> Result<Block, SpiError> {
        let mut block = [[0; BLOCK_BYTES]];
        self.driver.read(&mut block, at)?;
        let [block] = block;
        Ok(block)
    }

    fn timed<T>(&self, act: impl FnOnce(&Self) -> T) -> (T, Span) {
        let before = self.slot.now();
        let done = act(self);
        (done, self.slot.now().since(before))
    }

    #[track_caller]
    fn assert_in_order(&self) {
        assert!(self.slot.violations().is_empty(), "{:?}", self.slot.violations());
    }
}

#[test]
fn every_kind_of_card_is_written_and_read_to_its_last_block() {
    let sizes = [
        (Kind::Old, 64 * MIB),
        (Kind::Sdsc, 1_024 * MIB),
        (Kind::Sdhc, 8 * 1_024 * MIB),
        (Kind::Sdxc, 128 * 1_024 * MIB),
    ];
    for (kind, size) in sizes {
        let medium = Medium::new(size);
        let bench = Bench::new(Model::new(kind, medium.clone()));
        assert_eq!(bench.driver.num_blocks(), Ok(size), "{kind:?}");
        for at in [0, 1, size / 2, size - 8] {
            bench.write(at, &blocks(8)).expect("it takes many");
            bench.write(at, &[block(9)]).expect("it takes one");
            assert_eq!(medium.get(at), block(9), "{kind:?} {at}");
            for index in 1..8 {
                let read = bench.read(at + index);
                assert_eq!(read, Ok(block(index)), "{kind:?} {at} {index}");
            }
        }
        assert_eq!(bench.read(size).map(|_| ()), Err(SpiError::OutOfRange));
        assert_eq!(bench.write(size - 1, &blocks(2)), Err(SpiError::OutOfRange));
        assert_eq!(bench.driver.take_retries(), 0);
        bench.assert_in_order();
    }
}

#[test]
fn an_empty_slot_is_found_empty_soon() {
    let bench = Bench::new(None);
    let (done, took) = bench.timed(|bench| bench.read(0).map(|_| ()));
    assert_eq!(done, Err(SpiError::NoAnswer));
    assert!(took < Span::from_millis(250), "{took:?}");
    assert_eq!(SpiError::NoAnswer.trouble(), Trouble::Gone);
}

#[test]
fn a_card_may_take_a_second_to_start_and_not_for_ever() {
    for start_ms in [0, 1, 250, 999, 1_900] {
        let bench = Bench::new(Model { start_ns: start_ms * MS, ..card(Kind::Sdhc) });
        assert!(bench.read(0).is_ok(), "{start_ms} ms");
        bench.assert_in_order();
    }
    let bench = Bench::new(Model { start_ns: u64::MAX, ..card(Kind::Sdhc) });
    let (done, took) = bench.timed(|bench| bench.read(0).map(|_| ()));
    assert_eq!(done, Err(SpiError::Busy));
    assert!(took < Span::from_millis(2_300), "{took:?}");
}

#[test]
fn a_card_that_stands_still_for_two_and_a_half_seconds_is_waited_for() {
    for (count, skip) in [(1, 0), (8, 0), (8, 3), (8, 7)] {
        let busy = Plan::always(Fault::Busy(2_500 * MS)).skip(skip).times(1);
        let bench = Bench::new(card(Kind::Sdhc).with(busy));
        let (done, took) = bench.timed(|bench| bench.write(100, &blocks(count)));
        assert_eq!(done, Ok(()));
        assert!(took >= Span::from_millis(2_500), "{took:?}");
        assert_eq!(bench.read(100), Ok(block(0)));
        bench.assert_in_order();
    }
}

#[test]
fn a_card_that_never_becomes_ready_is_given_up() {
    for count in [1, 8] {
        let bench = Bench::new(card(Kind::Sdhc).with(Plan::always(Fault::Busy(u64::MAX))));
        let (done, took) = bench.timed(|bench| bench.write(100, &blocks(count)));
        assert_eq!(done, Err(SpiError::Busy));
        assert!(took < BUSY_MAX + BUSY_MAX + Span::from_millis(500), "{count}: {took:?}");
        assert_eq!(SpiError::Busy.trouble(), Trouble::Stuck);
        // A device that does not answer holds the line.
        let (done, took) = bench.timed(|bench| bench.read(0).map(|_| ()));
        assert_eq!(done, Err(SpiError::Busy));
        assert!(took < BUSY_MAX + Span::from_secs(1), "{took:?}");
        bench.assert_in_order();
    }
}

#[test]
fn a_card_that_is_busy_for_a_minute_is_interrupted_only_after_it_was_waited_for_again_and_again() {
    let bench = Bench::new(card(Kind::Sdhc).with(Plan::always(Fault::Busy(60_000 * MS)).times(1)));
    assert_eq!(bench.write(100, &[block(0)]), Err(SpiError::Busy));
    for time in 0..4 {
        assert_eq!(bench.read(0).map(|_| ()), Err(SpiError::Busy), "time {time}");
        bench.assert_in_order();
    }
    assert!(bench.read(0).is_ok(), "a reset helps this one");
    assert!(bench.slot.now() < hums_core::clock::Instant::from_millis(20_000));
}

#[test]
fn one_service_has_an_end_however_many_waits_are_in_it() {
    let bench = Bench::new(card(Kind::Sdhc).with(Plan::always(Fault::Busy(2_900 * MS))));
    bench.driver.begin_service();
    let (errors, took) =
        bench.timed(|bench| (0..10).filter_map(|at| bench.write(at, &[block(at)]).err()).collect::<Vec<_>>());
    assert_eq!(errors.first(), Some(&SpiError::OutOfTime));
    assert!(took >= SERVICE_MAX && took < SERVICE_MAX + Span::from_secs(2), "{took:?}");
    bench.driver.begin_service();
    bench.slot.event(Event::Insert(card(Kind::Sdhc)));
    assert_eq!(bench.write(0, &[block(0)]), Ok(()), "the next one has its own");
}

#[test]
fn what_is_damaged_on_its_way_is_sent_again() {
    for fault in
        [Fault::DamagedRead, Fault::DamagedWrite, Fault::DamagedCommand, Fault::Silent, Fault::NoBlock]
    {
        for skip in 0..12 {
            let bench = Bench::new(card(Kind::Sdhc));
            assert!(bench.driver.num_blocks().is_ok());
            let faulty = card(Kind::Sdhc).with(Plan::always(fault).skip(skip).times(1));
            let bench = Bench::new(Model { medium: Medium::new(64 * MIB), ..faulty });
            // A refused card is accepted at the next try.
            let first = bench.driver.num_blocks();
            assert!(first.is_ok() || bench.driver.num_blocks().is_ok(), "{fault:?} {skip}: {first:?}");
            assert_eq!(bench.write(7, &blocks(8)), Ok(()), "{fault:?} {skip}");
            assert_eq!(bench.write(30, &[block(3)]), Ok(()), "{fault:?} {skip}");
            for index in 0..8 {
                let read = bench.read(7 + index);
                assert_eq!(read, Ok(block(index)), "{fault:?} {skip}");
            }
            assert_eq!(bench.read(30), Ok(block(3)));
            bench.assert_in_order();
        }
    }
}

#[test]
fn what_is_always_damaged_is_told() {
    let ready = 50 * MS;
    for (fault, expected) in [
        (Fault::DamagedWrite, SpiError::Damaged),
        (Fault::WriteError, SpiError::NotWritten(4)),
        (Fault::NotProgrammed, SpiError::NotWritten(4)),
        (Fault::DamagedCommand, SpiError::Refused(8)),
        (Fault::Silent, SpiError::NoAnswer),
    ] {
        for count in [1, 8] {
            let bench = Bench::new(card(Kind::Sdhc).with(Plan::always(fault).from(ready)));
            assert!(bench.driver.num_blocks().is_ok());
            bench.slot.advance_to(ready);
            let (done, took) = bench.timed(|bench| bench.write(7, &blocks(count)));
            assert_eq!(done, Err(expected), "{fault:?} {count}");
            assert!(took < Span::from_secs(1), "{took:?}");
            bench.assert_in_order();
        }
    }
    for (fault, expected) in [
        (Fault::DamagedRead, SpiError::Damaged),
        (Fault::Token(0x08), SpiError::Token(8)),
        (Fault::Token(0x55), SpiError::Token(0x55)),
        (Fault::NoBlock, SpiError::NoData),
    ] {
        let bench = Bench::new(card(Kind::Sdhc).with(Plan::always(fault).from(ready)));
        assert!(bench.driver.num_blocks().is_ok());
        bench.slot.advance_to(ready);
        let (done, took) = bench.timed(|bench| bench.read(7).map(|_| ()));
        assert_eq!(done, Err(expected), "{fault:?}");
        assert!(took < Span::from_millis(3_300), "{took:?}");
        bench.assert_in_order();
    }
}

#[test]
fn a_row_that_fails_in_the_middle_leaves_nothing_open() {
    for skip in 0..8 {
        let bench = Bench::new(card(Kind::Sdhc).with(Plan::always(Fault::WriteError).skip(skip).times(1)));
        assert_eq!(bench.write(7, &blocks(8)), Err(SpiError::NotWritten(4)), "{skip}");
        assert_eq!(bench.write(7, &blocks(8)), Ok(()), "{skip}");
        assert_eq!(bench.read(14), Ok(block(7)));
        bench.assert_in_order();
    }
}

#[test]
fn a_write_protected_card_is_told_and_not_written() {
    for locked in [(true, false), (false, true)] {
        let medium = Medium::new(64 * MIB);
        let bench = Bench::new(Model { locked, ..Model::new(Kind::Sdhc, medium.clone()) });
        assert_eq!(bench.write(0, &[block(1)]), Err(SpiError::Locked));
        assert!(bench.read(0).is_ok(), "it can be read");
        assert_eq!(medium.writes(), 0);
        bench.assert_in_order();
    }
}

#[test]
fn a_bounce_at_any_byte_costs_a_second_try_and_nothing_else() {
    let clean = Bench::new(card(Kind::Sdhc));
    assert!(clean.driver.num_blocks().is_ok());
    let before = clean.slot.counts().bytes;
    assert!(clean.write(7, &blocks(3)).is_ok());
    let bytes = clean.slot.counts().bytes - before;
    for at in (0..bytes).step_by(3) {
        let medium = Medium::new(64 * MIB);
        let bench = Bench::new(Model::new(Kind::Sdhc, medium.clone()));
        assert!(bench.driver.num_blocks().is_ok());
        bench.slot.at_byte(before + at, Event::Bounce);
        assert_eq!(bench.write(7, &blocks(3)), Ok(()), "byte {at}");
        assert_eq!(bench.write(20, &blocks(2)), Ok(()), "byte {at}");
        for index in 0..3 {
            assert_eq!(medium.get(7 + index), block(index), "byte {at}");
        }
        assert!(bench.driver.take_retries() >= 1, "byte {at}");
    }
}

#[test]
fn another_card_is_never_taken_for_the_one_before() {
    let (first, second) = (Medium::new(64 * MIB), Medium::new(64 * MIB));
    let other = Model { serial: 99, ..Model::new(Kind::Sdhc, second.clone()) };
    let bench = Bench::new(Model::new(Kind::Sdhc, first.clone()));
    bench.write(7, &blocks(3)).expect("the first card");
    bench.slot.event(Event::Insert(other));
    assert_eq!(bench.write(7, &blocks(3)), Err(SpiError::Changed));
    assert_eq!(bench.write(7, &blocks(3)), Err(SpiError::Changed), "nor at the next try");
    assert_eq!(second.writes(), 0);
    bench.driver.reset();
    assert_eq!(bench.write(7, &blocks(3)), Ok(()), "once somebody has looked at it");
}

#[test]
fn a_card_is_identified_wherever_the_processor_left_it() {
    let clean = Bench::new(card(Kind::Sdhc));
    assert!(clean.driver.num_blocks().is_ok());
    let before = clean.slot.counts().bytes;
    assert!(clean.write(7, &blocks(3)).is_ok());
    let bytes = clean.slot.counts().bytes - before;
    for at in (0..bytes).step_by(7) {
        let bench = Bench::new(card(Kind::Sdhc));
        assert!(bench.driver.num_blocks().is_ok());
        bench.slot.stop_at(Some(before + at));
        let _ = bench.write(7, &blocks(3));
        bench.slot.stop_at(None);
        let driver = SpiCard::new(bench.slot.port());
        let done = driver.write(&blocks(2), 30);
        assert_eq!(done, Ok(()), "byte {at}");
        let interrupted = bench.slot.violations().into_keys().find(|what| what.contains("while busy"));
        assert_eq!(interrupted, None, "byte {at}");
    }
}

#[test]
fn noise_is_an_error_in_bounded_time_and_never_a_panic() {
    for from_ms in [0, 1, 5, 20, 40, 60, 80, 100] {
        let plan = Plan::always(Fault::Noise).from(from_ms * MS);
        let bench = Bench::new(card(Kind::Sdhc).with(plan));
        bench.slot.advance_to(from_ms * MS / 2);
        for at in 0..40 {
            bench.driver.begin_service();
            let ((), took) = bench.timed(|bench| {
                let _ = bench.write(at, &blocks(1 + at % 8));
                let _ = bench.read(at);
            });
            assert!(took < SERVICE_MAX + Span::from_secs(1), "{took:?}");
        }
    }
}
