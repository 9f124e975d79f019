//! Logs that are cut, damaged, or lack their parity, and data between and behind their sectors.

use std::fs;

use hums_blackbox::parity::{Parity, Sum};
use hums_blackbox::{Header, Sector};

use crate::copied::{BLOCK, all_say, copied, with_parity, without};
use crate::support::{attempt, flight, json, run, text};

#[test]
fn a_log_that_is_cut_in_flight_is_told_in_the_same_words_by_every_command() {
    let dir = tempfile::tempdir().expect("directory");
    attempt(
        dir.path(),
        &format!("sim {} --sd card.img --cut-after-writes 1000", flight("ap_quad_guided.tlog").display()),
    );
    all_say(dir.path(), "card.img", 3, &["not proved to its end: armed or in the air since "]);
    run(dir.path(), "sim PX4 --sd card.img", 0);
    all_say(
        dir.path(),
        "card.img",
        3,
        &["whole to its end, as the next start found it; armed or in the air since "],
    );
}

#[test]
fn the_time_of_day_is_known_in_a_short_log_with_a_damaged_sector() {
    let dir = copied(2);
    let whole = fs::read(dir.path().join("copied/00002_00.HUM")).expect("a log");
    for (sectors, damaged) in [(60, 40), (66, 64), (70, 64)] {
        let mut log = whole[..sectors * BLOCK].to_vec();
        log[damaged * BLOCK + 100] ^= 4;
        fs::write(dir.path().join("short.hum"), log).expect("written");
        run(dir.path(), "decode short.hum -o short.jsonl --format jsonl --force", 3);
        let file = fs::read_to_string(dir.path().join("short.jsonl")).expect("text");
        let stream = text(&run(dir.path(), "decode short.hum -o - --format jsonl", 3));
        assert!(file == stream && file.contains("\"time_utc\":\"2026-"), "{sectors} {damaged}");
    }
}

#[test]
fn a_header_that_counts_what_is_not_there_is_told_by_every_command() {
    let dir = copied(1);
    let path = dir.path().join("copied/00001_00.HUM");
    let whole = fs::read(&path).expect("a log");
    let blocks = || whole.as_chunks::<BLOCK>().0.iter();
    let header = |block: &[u8; BLOCK]| Header::read(block).ok();
    let closed =
        blocks().position(|block| header(block).is_some_and(|header| header.closed)).expect("it is closed");
    for (at, [frames, records]) in [(closed, [0, 1]), (closed, [1, 0]), (closed / 2, [-1, 0])] {
        let mut bytes = whole.clone();
        let block = bytes.as_chunks_mut::<BLOCK>().0.get_mut(at).expect("a block");
        let own = header(block).expect("a sector");
        let add = |byte: u8, number: i8| byte.wrapping_add_signed(number);
        (block[4], block[5]) = (add(block[4], 2 * records), add(block[5], frames));
        let mut sector = Sector::from_bytes(*block);
        sector.seal(own.session);
        *block = *sector.bytes();
        fs::write(&path, &bytes).expect("written");
        all_say(dir.path(), "copied", 3, &[]);
        let said = text(&attempt(dir.path(), "info --verify copied"));
        let told = said
            .lines()
            .any(|line| line.contains("FAILED  group decoding") || line.contains("FAILED  frames missing"));
        assert!(told, "sector {at}: {said}");
    }
}

#[test]
fn what_parity_contradicts_is_told_by_every_command() {
    let dir = copied(1);
    let path = dir.path().join("copied/00001_00.HUM");
    let whole = with_parity(&path);
    let blocks = || whole.as_chunks::<BLOCK>().0.iter();
    let header = |block: &[u8; BLOCK]| Header::read(block).ok();
    let closed =
        blocks().position(|block| header(block).is_some_and(|header| header.closed)).expect("it is closed");
    let mut erased = whole.clone();
    erased[(closed - 31) * BLOCK..(closed + 1) * BLOCK].fill(0xff);
    fs::write(&path, erased).expect("written");
    all_say(dir.path(), "copied", 3, &["32 sectors missing at its end: its parity covers them"]);
    let verified = |bytes: &[u8]| {
        fs::write(&path, bytes).expect("written");
        let said = text(&attempt(dir.path(), "info --verify copied"));
        (said.contains("FAILED  parity "), said.contains("1 sector had to be made again from parity"))
    };
    assert_eq!(verified(&whole), (false, false));
    let sealed = |block: &mut [u8; BLOCK]| {
        let mut sector = Sector::from_bytes(*block);
        sector.seal(sector.session());
        *block = *sector.bytes();
    };
    let mut altered = whole.clone();
    let block = altered.as_chunks_mut::<BLOCK>().0.get_mut(20).expect("a block");
    block[480] ^= 0x20;
    sealed(block);
    assert_eq!(verified(&altered), (true, false));
    let words = "every eighth sector from 4 to ";
    all_say(dir.path(), "copied", 3, &[words, "00001_00.HUM and the parity of these disagree"]);
    let mut parity = blocks().enumerate().filter_map(|(at, block)| Some((at, Parity::read(block)?)));
    let (at, one) = parity.find(|(_, one)| one.sum == Sum::P && one.last % 8 == 4).expect("parity of it");
    let mut lost = whole.clone();
    lost[20 * BLOCK..21 * BLOCK].fill(0);
    assert_eq!(verified(&lost), (false, true));
    let block = lost.as_chunks_mut::<BLOCK>().0.get_mut(at).expect("a block");
    block[480] ^= 0x20;
    Sum::P.seal(block, one.session, one.last);
    assert_eq!(verified(&lost), (true, false));
}

#[test]
fn sectors_that_parity_made_again_are_told_by_every_command() {
    let dir = copied(1);
    let path = dir.path().join("copied/00001_00.HUM");
    let whole = with_parity(&path);
    let sector = |at: usize| at * BLOCK..(at + 1) * BLOCK;
    let frames = |said: &str| said.lines().find(|line| line.contains("  frames ")).map(str::to_owned);
    let before = frames(&text(&run(dir.path(), "info copied", 0)));
    let mut flipped = whole.clone();
    flipped[20 * BLOCK + 100] ^= 1;
    let mut erased = whole.clone();
    erased[20 * BLOCK..28 * BLOCK].fill(0xff);
    let mut zeroed = whole.clone();
    zeroed[sector(20)].fill(0);
    let mut copied = whole.clone();
    copied.copy_within(sector(20), 40 * BLOCK);
    let mut swapped = whole.clone();
    swapped[sector(20)].copy_from_slice(&whole[sector(40)]);
    swapped[sector(40)].copy_from_slice(&whole[sector(20)]);
    for (damaged, count) in [
        (flipped, "1 sector"),
        (erased, "8 sectors"),
        (zeroed, "1 sector"),
        (copied, "1 sector"),
        (swapped, "2 sectors"),
    ] {
        fs::write(&path, damaged).expect("written");
        let words = format!("{count} had to be made again from parity, without a loss: keep the original");
        all_say(dir.path(), "copied", 3, &[&words]);
        let said = text(&run(dir.path(), "info --verify copied", 3));
        let last = said.lines().last().expect("a verdict");
        assert!(last.starts_with(&format!("1 session: nothing is lost; {words}")), "{said}");
        assert_eq!((said.matches("FAILED").count(), said.matches("rebuilt").count()), (0, 1), "{said}");
        let listed = text(&run(dir.path(), "info --list copied", 3));
        assert!(listed.contains("; repaired from its parity, nothing is lost"), "{listed}");
        let json = json(&run(dir.path(), "info --verify --json copied", 3));
        let made_again = json["logs"][0]["blocks"]["repaired"].as_u64().expect("a number");
        assert_eq!((&json["ok"], &json["logs"][0]["ok"]), (&false.into(), &false.into()));
        assert!(count.starts_with(&made_again.to_string()), "{json}");
        assert_eq!(frames(&text(&run(dir.path(), "info copied", 3))), before);
        let screen = text(&run(dir.path(), "check copied", 3));
        assert!(screen.contains("; the log is repaired from its parity, nothing is lost"), "{screen}");
    }
    fs::copy(&path, dir.path().join("copied/00002_00.HUM")).expect("a copy");
    let table = text(&run(dir.path(), "check copied", 3));
    assert!(table.contains("repaired from its parity, nothing is lost\n"), "{table}");
    assert!(table.contains("1  repaired from its parity, nothing is lost (counted above too)"), "{table}");
    fs::remove_file(dir.path().join("copied/00002_00.HUM")).expect("ours");
    fs::write(dir.path().join("copied/Copy of 00001_00.HUM"), &whole).expect("written");
    let said = text(&run(dir.path(), "info --verify copied", 3));
    assert!(said.contains("not counted") && said.contains("2 sectors had to be made again"), "{said}");
}

#[test]
fn parity_that_is_gone_is_told_by_every_command() {
    let dir = copied(1);
    let path = dir.path().join("copied/00001_00.HUM");
    let whole = with_parity(&path);
    let is_parity = |block: &[u8; BLOCK]| Parity::read(block).is_some();
    let all = whole.as_chunks::<BLOCK>().0.iter().filter(|block| is_parity(block)).count();
    for (most, with, words) in [
        (all, 0, format!("{all} parity sectors are missing: what the card loses")),
        (all, 0xff, format!("{all} parity sectors are missing: what the card loses")),
        (1, 0, "1 parity sector is missing: what the card loses".to_owned()),
    ] {
        fs::write(&path, without(&whole, most, with)).expect("written");
        all_say(dir.path(), "copied", 3, &[&words]);
        let said = text(&run(dir.path(), "info --verify copied", 3));
        let last = said.lines().last().expect("a verdict");
        assert!(last.starts_with(&format!("1 session: nothing is lost; {words}")), "{said}");
        assert_eq!(said.matches("FAILED").count(), 1, "{said}");
        assert!(said.contains("FAILED  sectors protected"), "{said}");
        assert_eq!(json(&run(dir.path(), "info --verify --json copied", 3))["ok"], false);
        let screen = text(&run(dir.path(), "check copied", 3));
        assert!(screen.contains("; the log is whole, without all of its parity"), "{screen}");
    }
    let long = flight("ap_quad_guided.tlog");
    run(dir.path(), &format!("sim {} --sd long.img --card-size 64", long.display()), 0);
    let mut long = with_parity(&dir.path().join("long.img"));
    let blocks = long.as_chunks_mut::<BLOCK>().0;
    let end = blocks.iter().rposition(|block| Header::read(block).is_ok()).expect("a sector");
    assert!(end > 540, "{end}");
    blocks[520..=end].iter_mut().for_each(|block| block.fill(0));
    let is_later = |block: &[u8; BLOCK]| Parity::read(block).is_some_and(|one| one.last >= 504);
    blocks.iter_mut().filter(|block| is_later(block)).for_each(|block| block.fill(0));
    for (bytes, is_told) in [(long.clone(), false), (without(&long, usize::MAX, 0), true)] {
        fs::write(&path, bytes).expect("written");
        let said = text(&run(dir.path(), "info --verify copied", 3));
        assert_eq!(said.contains("FAILED  sectors protected  16 checked, 16 failed"), is_told, "{said}");
    }
}

#[test]
fn a_sector_that_was_put_between_the_last_ones_costs_no_frame() {
    let dir = copied(1);
    let path = dir.path().join("copied/00001_00.HUM");
    let whole = with_parity(&path);
    let blocks = whole.as_chunks::<BLOCK>().0;
    let closed = blocks.iter().rposition(|block| Header::read(block).is_ok()).expect("a sector");
    let frames = || {
        let json = json(&attempt(dir.path(), "info --json copied"));
        (json["logs"][0]["frames"].clone(), json["logs"][0]["gaps_count"].clone())
    };
    let before = frames();
    for (back, put) in [(3, 1), (9, 1)] {
        let mut longer = whole.clone();
        let at = (closed - back) * BLOCK;
        longer.splice(at..at, whole[18 * BLOCK..(18 + put) * BLOCK].to_vec());
        fs::write(&path, longer).expect("written");
        assert_eq!(frames(), before, "{put} put {back} sectors before the end");
        run(dir.path(), "info --verify copied", 3);
    }
}

#[test]
fn blocks_that_do_not_count_are_counted_by_verify_and_info() {
    let dir = copied(1);
    let path = dir.path().join("copied/00001_00.HUM");
    let mut log = fs::read(&path).expect("there");
    let last =
        log.as_chunks::<BLOCK>().0.iter().rposition(|block| Header::read(block).is_ok()).expect("a sector");
    let mut block = |at: usize, change: &dyn Fn(&mut [u8; BLOCK])| {
        let (from, to) = (last * BLOCK, (last + at) * BLOCK);
        log.copy_within(from..from + BLOCK, to);
        change(log[to..].first_chunk_mut().expect("a block"));
    };
    block(1, &|block| {
        let mut sector = Sector::from_bytes(*block);
        sector.set_partial(true);
        sector.seal(sector.session());
        *block = *sector.bytes();
    });
    block(2, &|block| {
        block[11..15].copy_from_slice(&(last as u32 + 10).to_le_bytes());
        let mut sector = Sector::from_bytes(*block);
        sector.seal(sector.session() ^ 1);
        *block = *sector.bytes();
    });
    block(3, &|block| block.fill(0x5a));
    fs::write(&path, log).expect("written");
    for command in ["info --verify -v", "info"] {
        let said = text(&run(dir.path(), &format!("{command} copied"), 0));
        for words in ["1 sector superseded", "1 block of another session, 1 block that is no sector"] {
            assert!(said.contains(words), "{command}: `{words}` is not in {said}");
        }
    }
}

#[test]
fn noise_behind_the_last_end_mark_is_told_by_every_command() {
    let dir = copied(1);
    let path = dir.path().join("copied/00001_00.HUM");
    let log = without(&fs::read(&path).expect("a log"), usize::MAX, 0);
    let last = log
        .as_chunks::<BLOCK>()
        .0
        .iter()
        .rposition(|block| block.starts_with(&[0x48, 0xb3]))
        .expect("sectors");
    let mut noisy = log.clone();
    let noise = |(at, byte): (usize, &mut u8)| *byte = (at * 7 % 251) as u8 + 1;
    noisy[last * BLOCK..(last + 1) * BLOCK].iter_mut().enumerate().for_each(noise);
    fs::write(&path, noisy).expect("written");
    all_say(dir.path(), "copied", 3, &["1 block that is no sector"]);
    let said = text(&run(dir.path(), "info --verify copied", 3));
    assert!(said.contains("FAILED  end "), "{said}");
    let mut forged = log.clone();
    forged[last * BLOCK..(last + 1) * BLOCK].iter_mut().enumerate().for_each(noise);
    forged[last * BLOCK..][..2].copy_from_slice(&[0x48, 0xb3]);
    fs::write(&path, forged).expect("written");
    let said = text(&run(dir.path(), "info --verify copied", 3));
    assert!(
        said.contains("1 block with the head of a sector") && !said.contains("of another session"),
        "{said}"
    );
    let mut film = log.clone();
    film[last * BLOCK..].iter_mut().enumerate().for_each(noise);
    fs::write(&path, film).expect("written");
    let said = text(&run(dir.path(), "info --verify -v copied", 0));
    assert!(said.contains("blocks that are no sectors") && said.contains("cannot be proved"), "{said}");
    for empty in [0x00, 0xff] {
        let mut log = log.clone();
        log[last * BLOCK..(last + 1) * BLOCK].fill(empty);
        fs::write(&path, log).expect("written");
        let said = text(&attempt(dir.path(), "info copied"));
        assert!(!said.contains("that is no sector"), "{said}");
    }
}
