//! Every operation of flash and card is cut by power, and the next start goes on. The simulated flash leaves a cut word or erase
//! half done, the simulated card is a FAT32 volume in memory.

use std::cell::{Cell, RefCell};
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

use ed25519_compact::{KeyPair, Seed};
use hums_recorder::{BLOCK_BYTES, Block, CardDevice};

use crate::header::{BYTES, Header, Refusal, Version};
use crate::message::Message;
use crate::resident::{CRASHES_MAX, STARTS_MAX, append, application};
use crate::resident::{Cause, Decision, Flash, FlashFailure, Job, Region, Resident, WorkResult, decide};
use crate::state::{Record, State, Status};
use crate::{PREVIOUS, UPDATE};

const BOARD: &str = "matek";
const SECTOR_BYTES: usize = 512;
const SECTORS: usize = 4;
const STATE_BYTES: usize = 1_024;
/// Of the driver of a card (`hums_recorder::SpiCard`); an erase takes as long.
const SERVICE_SECS: u32 = 8;
/// Two sectors behind the header's, the last one in part.
const IMAGE_BYTES: usize = 700;

struct PowerCut;

thread_local! {
    /// Operations until power goes.
    static LEFT: Cell<u32> = const { Cell::new(u32::MAX) };
    static USED: Cell<u32> = const { Cell::new(0) };
    /// Seconds.
    static NOW: Cell<u32> = const { Cell::new(0) };
}

/// Whether power goes in this operation.
fn is_cut() -> bool {
    USED.set(USED.get() + 1);
    let left = LEFT.get();
    LEFT.set(left.saturating_sub(1));
    left == 0
}

fn powered<T>(operations: u32, act: impl FnOnce() -> T) -> Option<T> {
    LEFT.set(operations);
    let done = catch_unwind(AssertUnwindSafe(act));
    LEFT.set(u32::MAX);
    match done {
        Ok(done) => Some(done),
        Err(why) if why.is::<PowerCut>() => None,
        Err(why) => resume_unwind(why),
    }
}

/// The flash, and a random number for cut operations.
#[derive(Clone)]
struct Nor {
    state: Vec<u8>,
    application: Vec<u8>,
    random: u64,
    refuses: bool,
}

impl Nor {
    fn new(random: u64) -> Self {
        let (state, application) = (vec![0xFF; STATE_BYTES], vec![0xFF; SECTORS * SECTOR_BYTES]);
        Self { state, application, random: random | 1, refuses: false }
    }

    fn holding(random: u64, file: &[u8]) -> Self {
        let mut nor = Self::new(random);
        nor.application[..file.len()].copy_from_slice(file);
        nor
    }

    fn random(&mut self) -> u8 {
        self.random =
            self.random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.random >> 56) as u8
    }

    fn of(&mut self, region: Region) -> &mut [u8] {
        if region == Region::State { &mut self.state } else { &mut self.application }
    }
}

impl Flash for Nor {
    fn read(&self, region: Region) -> &[u8] {
        if region == Region::State { &self.state } else { &self.application }
    }

    fn sector_bytes(&self) -> usize {
        SECTOR_BYTES
    }

    fn program(&mut self, region: Region, offset: usize, word: u32) -> Result<(), FlashFailure> {
        let cut = is_cut();
        for (index, bits) in word.to_le_bytes().into_iter().enumerate() {
            let kept = if cut { self.random() } else { 0 };
            let refused = if self.refuses { 0xFF } else { 0 };
            self.of(region)[offset + index] &= bits | kept | refused;
        }
        if cut {
            std::panic::panic_any(PowerCut);
        }
        if self.refuses { Err(FlashFailure) } else { Ok(()) }
    }

    fn erase(&mut self, region: Region, sector: usize) -> Result<(), FlashFailure> {
        NOW.set(NOW.get() + SERVICE_SECS);
        let cut = is_cut();
        let bytes = if region == Region::State { STATE_BYTES } else { SECTOR_BYTES };
        for at in sector * bytes..(sector + 1) * bytes {
            let set = if cut { self.random() & self.random() } else { 0xFF };
            self.of(region)[at] |= set;
        }
        if cut {
            std::panic::panic_any(PowerCut);
        }
        if self.refuses { Err(FlashFailure) } else { Ok(()) }
    }

    fn progress(&mut self) {}
}

/// A card of these files, in a row. It is gone after so many blocks, or gives other content for a block later on.
#[derive(Default)]
struct Disk {
    files: Vec<(crate::files::Name, Vec<u8>)>,
    reads: Cell<u32>,
    /// All answers are late from this second on.
    deadline: Cell<Option<u32>>,
    gone_after: Cell<Option<u32>>,
    /// From this read on the file of this number stands in the place of the first one.
    changes: RefCell<Option<(u32, usize)>>,
}

const CLUSTERS: u32 = hums_recorder::layout::FAT32_CLUSTERS_MIN + 10;
const FAT_BLOCKS: u32 = (CLUSTERS + 2).div_ceil(128);
const START: u32 = 64;
const RESERVED: u32 = 32;

impl Disk {
    fn of(files: &[(&crate::files::Name, &[u8])]) -> Self {
        let files = files.iter().map(|(name, file)| (**name, file.to_vec())).collect();
        Self { files, ..Self::default() }
    }

    fn is_there(&self) -> Result<(), ()> {
        let is_gone = self.gone_after.get().is_some_and(|after| self.reads.get() > after);
        let is_late = self.deadline.get().is_some_and(|deadline| NOW.get() >= deadline);
        if is_gone || is_late { Err(()) } else { Ok(()) }
    }

    fn first(&self, number: usize) -> u32 {
        3 + self.files[..number]
            .iter()
            .map(|(_, file)| file.len().div_ceil(BLOCK_BYTES) as u32 + 1)
            .sum::<u32>()
    }

    fn block(&self, at: u32) -> Block {
        let mut block = [0; BLOCK_BYTES];
        let put = |block: &mut Block, at: usize, value: u32| {
            block[at..at + 4].copy_from_slice(&value.to_le_bytes());
        };
        let data = START + RESERVED + FAT_BLOCKS;
        if at == 0 {
            block[450] = 0x0C;
            put(&mut block, 454, START);
            put(&mut block, 458, RESERVED + FAT_BLOCKS + CLUSTERS);
            block[510..].copy_from_slice(&[0x55, 0xAA]);
        } else if at == START {
            block[11..17].copy_from_slice(&[0, 2, 1, RESERVED as u8, 0, 1]);
            put(&mut block, 32, RESERVED + FAT_BLOCKS + CLUSTERS);
            put(&mut block, 36, FAT_BLOCKS);
            put(&mut block, 44, 2);
            block[48] = 1;
            block[510..].copy_from_slice(&[0x55, 0xAA]);
        } else if (START + RESERVED..data).contains(&at) {
            let first = (at - START - RESERVED) * 128;
            for (number, (_, file)) in self.files.iter().enumerate() {
                let (from, count) = (self.first(number), file.len().div_ceil(BLOCK_BYTES) as u32);
                for cluster in (from..from + count).filter(|cluster| (first..first + 128).contains(cluster)) {
                    let next = if cluster + 1 < from + count { cluster + 1 } else { 0x0FFF_FFFF };
                    put(&mut block, 4 * (cluster - first) as usize, next);
                }
            }
        } else if at == data {
            for (number, (name, file)) in self.files.iter().enumerate() {
                let entry = 32 * number;
                block[entry..entry + 11].copy_from_slice(name);
                put(&mut block, entry + 28, file.len() as u32);
                block[entry + 26..entry + 28].copy_from_slice(&(self.first(number) as u16).to_le_bytes());
            }
        } else if at > data {
            let cluster = at - data + 2;
            for (number, (_, file)) in self.files.iter().enumerate() {
                let changed =
                    self.changes.borrow().filter(|(from, _)| number == 0 && self.reads.get() >= *from);
                let file = changed.map_or(file, |(_, other)| &self.files[other].1);
                if let Some(from) = cluster.checked_sub(self.first(number)) {
                    let from = from as usize * BLOCK_BYTES;
                    if let Some(rest) = file.get(from..) {
                        let length = rest.len().min(BLOCK_BYTES);
                        block[..length].copy_from_slice(&rest[..length]);
                        break;
                    }
                }
            }
        }
        block
    }
}

impl CardDevice for Disk {
    type Error = ();

    fn read(&self, blocks: &mut [Block], start: u32) -> Result<(), ()> {
        if is_cut() {
            std::panic::panic_any(PowerCut);
        }
        self.reads.set(self.reads.get() + 1);
        self.is_there()?;
        for (block, at) in blocks.iter_mut().zip(start..) {
            *block = self.block(at);
        }
        Ok(())
    }

    fn write(&self, _: &[Block], _: u32) -> Result<(), ()> {
        panic!("the resident program never writes to a card");
    }

    fn begin_service(&self) {
        self.deadline.set(Some(NOW.get() + SERVICE_SECS));
    }

    fn num_blocks(&self) -> Result<u32, ()> {
        self.is_there()?;
        Ok(START + RESERVED + FAT_BLOCKS + CLUSTERS)
    }
}

fn key(number: u8) -> KeyPair {
    KeyPair::from_seed(Seed::new([number; 32]))
}

fn image(number: u8) -> Vec<u8> {
    (0..IMAGE_BYTES).map(|at| (at as u8).wrapping_mul(31) ^ number).collect()
}

fn signed(number: u8, version: u32, floor: u32) -> Vec<u8> {
    let image = image(number);
    let mut header = Header::new(BOARD, "commit", Version(version), Version(floor), &image);
    header.sign(&image, &key(1).sk);
    [&header.bytes()[..], &image].concat()
}

fn id(file: &[u8]) -> u32 {
    Header::read(file).unwrap().id()
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Runs {
    /// The application of this id, on trial or not.
    Application(u32, bool),
    Waits,
}

/// One power-on, with the resets that the resident program makes itself, up to the application or a wait. Each message goes to
/// `told`.
fn start(nor: &mut Nor, disk: &Disk, mut cause: Cause, told: &mut Vec<Message>) -> Runs {
    let key = *key(1).pk;
    for _ in 0..10 {
        match decide(nor, BOARD, cause) {
            Decision::Start { on_trial } => {
                let file = Header::read(&nor.application).unwrap();
                let end = BYTES + file.image_bytes as usize;
                assert_eq!(
                    file.image_crc,
                    crate::crc32(0, &nor.application[BYTES..end]),
                    "a damaged image is started"
                );
                return Runs::Application(file.id(), on_trial);
            }
            Decision::Work(job) => {
                let mut resident = Resident { flash: nor, card: disk, board: BOARD, keys: &[[9; 32], key] };
                match resident.work(job) {
                    WorkResult::Restart(message) => told.push(message),
                    WorkResult::Wait(_) => return Runs::Waits,
                }
            }
        }
        cause = Cause::Crash;
    }
    panic!("it restarts again and again");
}

fn begin(nor: &mut Nor, disk: &Disk, cause: Cause) -> (Runs, Vec<Message>) {
    NOW.set(NOW.get() + 2 * SERVICE_SECS);
    let mut told = Vec::new();
    let runs = start(nor, disk, cause, &mut told);
    (runs, told)
}

#[test]
fn an_update_is_installed_put_on_trial_and_confirmed() {
    let (old, new) = (signed(1, 1, 0), signed(2, 2, 1));
    let (mut nor, disk) = (Nor::holding(1, &old), Disk::of(&[(UPDATE, &new)]));
    assert_eq!(begin(&mut nor, &disk, Cause::Usual), (Runs::Application(id(&old), false), vec![]));
    let (runs, told) = begin(&mut nor, &disk, Cause::Asked);
    assert_eq!((runs, told), (Runs::Application(id(&new), true), vec![Message::Installed]));
    append(&mut nor, Record::Confirmed(Version(1)), id(&new)).unwrap();
    let (runs, told) = begin(&mut nor, &disk, Cause::Usual);
    assert_eq!((runs, told), (Runs::Application(id(&new), false), vec![]));
    assert_eq!(nor.application[..new.len()], new);
    // Its floor holds from now on.
    let older = Disk::of(&[(UPDATE, &signed(3, 0, 0))]);
    let (runs, told) = begin(&mut nor, &older, Cause::Asked);
    assert_eq!(runs, Runs::Application(id(&new), false));
    assert!(matches!(told[..], [Message::Refused(Refusal::TooOld)]), "{told:?}");
}

/// Cuts each operation of an update. Then power comes back with the same card, or first without one.
#[test]
fn power_that_goes_in_any_operation_leaves_an_application_or_a_wait_for_the_card() {
    let (old, new) = (signed(1, 1, 0), signed(2, 2, 0));
    let disk = Disk::of(&[(PREVIOUS, &old), (UPDATE, &new)]);
    let empty = Disk::of(&[]);
    USED.set(0);
    begin(&mut Nor::holding(1, &old), &disk, Cause::Asked);
    let operations = USED.get();
    assert!(operations > 300, "{operations}");
    let (mut waits, mut olds) = (0, 0);
    for cut in 0..operations {
        let mut nor = Nor::holding(u64::from(cut) << 8, &old);
        assert_eq!(powered(cut, || begin(&mut nor, &disk, Cause::Asked)), None, "{cut}");
        let mut without = nor.clone();
        match begin(&mut without, &empty, Cause::Usual).0 {
            Runs::Application(which, trial) => {
                assert!(which == id(&old) && !trial || which == id(&new) && trial, "{cut}");
            }
            Runs::Waits => waits += 1,
        }
        let mut nor = if cut % 2 == 0 { nor } else { without };
        // A second cut while it goes on.
        let again = powered(cut.wrapping_mul(7) % operations, || begin(&mut nor, &disk, Cause::Usual));
        let runs = again.unwrap_or_else(|| begin(&mut nor, &disk, Cause::Usual)).0;
        assert!(matches!(runs, Runs::Application(..)), "{cut}: {runs:?}");
        olds += u32::from(runs == Runs::Application(id(&old), false));
    }
    assert!(waits > operations / 2 && olds > 0, "{waits} waits, {olds} times the old one of {operations}");
}

#[test]
fn a_card_that_is_pulled_at_any_block_changes_nothing_or_is_waited_for() {
    let (old, new) = (signed(1, 1, 0), signed(2, 2, 0));
    let disk = Disk::of(&[(UPDATE, &new)]);
    begin(&mut Nor::holding(1, &old), &disk, Cause::Asked);
    for after in 0..disk.reads.get() {
        let disk = Disk::of(&[(UPDATE, &new)]);
        let mut nor = Nor::holding(1, &old);
        disk.gone_after.set(Some(after));
        match begin(&mut nor, &disk, Cause::Asked) {
            (Runs::Application(which, false), told) => {
                assert_eq!(which, id(&old));
                assert!(matches!(told[..], [Message::Refused(Refusal::NoFile)]), "{told:?}");
            }
            (runs, _) => assert_eq!(runs, Runs::Waits),
        }
        disk.gone_after.set(None);
        let runs = begin(&mut nor, &disk, Cause::Asked).0;
        assert_eq!(runs, Runs::Application(id(&new), true), "after {after} blocks");
    }
}

#[test]
fn a_card_that_gives_another_image_at_the_second_reading_never_starts_it() {
    let (old, good, other) = (signed(1, 1, 0), signed(2, 2, 0), vec![0x5A; 512 + IMAGE_BYTES]);
    let disk = Disk::of(&[(UPDATE, &good), (b"OTHER   BIN", &other)]);
    begin(&mut Nor::holding(1, &old), &disk, Cause::Asked);
    for from in 0..disk.reads.get() {
        let disk = Disk::of(&[(UPDATE, &good), (b"OTHER   BIN", &other)]);
        *disk.changes.borrow_mut() = Some((from, 1));
        let mut nor = Nor::holding(1, &old);
        // `start` compares each started image with its checksum.
        begin(&mut nor, &disk, Cause::Asked);
        *disk.changes.borrow_mut() = None;
        assert!(matches!(begin(&mut nor, &disk, Cause::Usual).0, Runs::Application(..)));
    }
}

#[test]
fn each_wrong_image_is_refused_with_its_reason_before_anything_is_erased() {
    let (old, good) = (signed(1, 5, 3), signed(2, 6, 0));
    let changed = |change: &dyn Fn(&mut Header)| {
        let image = image(2);
        let mut header = Header::new(BOARD, "", Version(6), Version(0), &image);
        change(&mut header);
        header.sign(&image, &key(1).sk);
        [&header.bytes()[..], &image].concat()
    };
    let mut foreign = Header::new(BOARD, "", Version(6), Version(0), &image(2));
    let unsigned = [&foreign.bytes()[..], &image(2)].concat();
    foreign.sign(&image(2), &key(2).sk);
    let foreign = [&foreign.bytes()[..], &image(2)].concat();
    let damaged = |at: usize| {
        let mut file = good.clone();
        file[at] ^= 1;
        file
    };
    let mut forged = Header::read(&good).unwrap();
    forged.version = Version(7);
    let forged = [&forged.bytes()[..], &image(2)].concat();
    let cases = [
        (changed(&|header| header.board = [b'x'; 32]), Refusal::OtherBoard),
        (changed(&|header| header.version = Version(2)), Refusal::TooOld),
        (foreign, Refusal::ForeignKey),
        (unsigned, Refusal::ForeignKey),
        (damaged(3), Refusal::Damaged),
        (damaged(100), Refusal::Damaged),
        (damaged(512), Refusal::BadSignature),
        (damaged(512 + IMAGE_BYTES - 1), Refusal::BadSignature),
        (forged, Refusal::BadSignature),
        (good[..good.len() - 4].to_vec(), Refusal::Damaged),
        ([&good[..], &[0; 4]].concat(), Refusal::Damaged),
        (Vec::new(), Refusal::Damaged),
        (good[..100].to_vec(), Refusal::Damaged),
    ];
    for (index, (file, wanted)) in cases.iter().enumerate() {
        let mut nor = Nor::holding(1, &old);
        let before = nor.clone();
        let (runs, told) = begin(&mut nor, &Disk::of(&[(UPDATE, file)]), Cause::Asked);
        assert_eq!(runs, Runs::Application(id(&old), false));
        assert!(matches!(&told[..], [Message::Refused(why)] if why == wanted), "{index}: {told:?}");
        assert!(nor.application == before.application && nor.state == before.state, "{index}");
    }
}

#[test]
fn an_image_that_crashes_gives_way_to_the_one_before_and_is_not_taken_again() {
    let (old, bad) = (signed(1, 1, 0), signed(2, 2, 0));
    let disk = Disk::of(&[(UPDATE, &bad), (PREVIOUS, &old)]);
    let mut nor = Nor::holding(1, &old);
    let (mut runs, _) = begin(&mut nor, &disk, Cause::Asked);
    let mut starts = 0;
    let mut told = Vec::new();
    while runs == Runs::Application(id(&bad), true) {
        starts += 1;
        (runs, told) = begin(&mut nor, &disk, Cause::Crash);
    }
    assert_eq!(
        (starts, runs, told),
        (CRASHES_MAX, Runs::Application(id(&old), true), vec![Message::FellBack])
    );
    append(&mut nor, Record::Confirmed(Version(0)), id(&old)).unwrap();
    assert!(State::read(&nor.state).has_failed(id(&bad)));
    let (runs, told) = begin(&mut nor, &disk, Cause::Asked);
    let why = Refusal::FailedBefore;
    assert_eq!((runs, told), (Runs::Application(id(&old), false), vec![Message::Refused(why)]));
}

#[test]
fn an_image_that_crashes_without_another_one_gets_a_trial_again_and_again() {
    let bad = signed(2, 2, 0);
    let disk = Disk::of(&[(UPDATE, &bad)]);
    let mut nor = Nor::new(1);
    let trial = Runs::Application(id(&bad), true);
    assert_eq!(begin(&mut nor, &disk, Cause::Usual).0, trial);
    for _ in 0..100 {
        for _ in 1..CRASHES_MAX {
            assert_eq!(begin(&mut nor, &disk, Cause::Crash).0, trial);
        }
        let (runs, told) = begin(&mut nor, &disk, Cause::Crash);
        assert_eq!((runs, told), (trial, vec![Message::Retried]));
    }
    // A better image on the card ends that.
    let good = signed(3, 3, 0);
    let disk = Disk::of(&[(UPDATE, &good)]);
    for _ in 1..CRASHES_MAX {
        begin(&mut nor, &disk, Cause::Crash);
    }
    assert_eq!(begin(&mut nor, &disk, Cause::Crash).0, Runs::Application(id(&good), true));
}

#[test]
fn a_person_may_switch_off_within_the_first_minute_but_not_for_ever() {
    let (old, new) = (signed(1, 1, 0), signed(2, 2, 0));
    let disk = Disk::of(&[(UPDATE, &new), (PREVIOUS, &old)]);
    let mut nor = Nor::holding(1, &old);
    let (mut runs, _) = begin(&mut nor, &disk, Cause::Asked);
    let mut starts = 0;
    while runs == Runs::Application(id(&new), true) {
        starts += 1;
        runs = begin(&mut nor, &disk, Cause::Usual).0;
    }
    assert_eq!((starts, runs), (STARTS_MAX, Runs::Application(id(&old), true)));
}

#[test]
fn a_box_without_an_application_takes_the_one_before_if_the_update_is_none() {
    let old = signed(1, 1, 0);
    let disk = Disk::of(&[(UPDATE, &[1; 600]), (PREVIOUS, &old)]);
    let mut nor = Nor::new(1);
    assert_eq!(decide(&mut nor, BOARD, Cause::Usual), Decision::Work(Job::Restore));
    assert_eq!(begin(&mut nor, &disk, Cause::Usual).0, Runs::Application(id(&old), true));
}

#[test]
fn a_trial_ends_wherever_the_state_is_full() {
    let (old, bad) = (signed(1, 1, 0), signed(2, 2, 0));
    let disk = Disk::of(&[(UPDATE, &bad), (PREVIOUS, &old)]);
    for records in 0..STATE_BYTES / 16 {
        let mut nor = Nor::holding(1, &bad);
        for _ in 0..records {
            append(&mut nor, Record::Start { crashed: false }, 7).unwrap();
        }
        append(&mut nor, Record::Trial, id(&bad)).unwrap();
        let starts = (0..20)
            .take_while(|_| begin(&mut nor, &disk, Cause::Crash).0 == Runs::Application(id(&bad), true));
        assert!(starts.count() <= CRASHES_MAX as usize, "{records}");
        assert_eq!(begin(&mut nor, &disk, Cause::Usual).0, Runs::Application(id(&old), true), "{records}");
    }
}

#[test]
fn the_floor_of_an_image_that_a_cable_loaded_holds_after_a_cut() {
    let (cable, new, older) = (signed(1, 5, 4), signed(2, 6, 0), signed(3, 3, 0));
    let disk = Disk::of(&[(UPDATE, &new)]);
    USED.set(0);
    begin(&mut Nor::holding(1, &cable), &disk, Cause::Asked);
    let mut nor = Nor::holding(1, &cable);
    powered(USED.get() / 2, || begin(&mut nor, &disk, Cause::Asked));
    assert_eq!(application(&nor, BOARD), None);
    assert_eq!(begin(&mut nor, &Disk::of(&[(UPDATE, &older)]), Cause::Usual).0, Runs::Waits);
}

#[test]
fn an_application_that_a_cable_loaded_needs_no_trial_whatever_the_state_has() {
    let (old, new) = (signed(1, 1, 0), signed(2, 2, 0));
    let mut nor = Nor::holding(1, &new);
    for record in [Record::Trial, Record::Start { crashed: true }, Record::Failed] {
        append(&mut nor, record, id(&old)).unwrap();
        let runs = begin(&mut nor, &Disk::of(&[]), Cause::Crash).0;
        assert_eq!(runs, Runs::Application(id(&new), false));
    }
}

#[test]
fn a_full_state_makes_room_and_keeps_the_floor() {
    let old = signed(1, 5, 0);
    let mut nor = Nor::holding(1, &old);
    append(&mut nor, Record::Confirmed(Version(4)), id(&old)).unwrap();
    let mut full = 0;
    for number in 2..40 {
        let new = signed(number, 5, 0);
        let disk = Disk::of(&[(UPDATE, &new)]);
        assert_eq!(begin(&mut nor, &disk, Cause::Asked).0, Runs::Application(id(&new), true), "{number}");
        append(&mut nor, Record::Confirmed(Version(0)), id(&new)).unwrap();
        full += u32::from(State::read(&nor.state).free < 100);
        let (_, told) = begin(&mut nor, &Disk::of(&[(UPDATE, &signed(99, 3, 0))]), Cause::Asked);
        assert!(matches!(told[..], [Message::Refused(Refusal::TooOld)]), "{number}: {told:?}");
    }
    assert!(full > 1, "{full}");
}

#[test]
fn flash_that_refuses_ends_with_the_application_or_a_wait() {
    let (old, new) = (signed(1, 1, 0), signed(2, 2, 0));
    let disk = Disk::of(&[(UPDATE, &new)]);
    let mut nor = Nor::holding(1, &old);
    nor.refuses = true;
    let (runs, told) = begin(&mut nor, &disk, Cause::Asked);
    assert_eq!(runs, Runs::Application(id(&old), false));
    assert!(matches!(told[..], [Message::Refused(Refusal::Flash)]), "{told:?}");
    assert!(application(&nor, BOARD).is_some() && application(&nor, "other").is_none());
    assert_eq!(State::read(&nor.state).status(id(&new)), Status::Confirmed);
}
