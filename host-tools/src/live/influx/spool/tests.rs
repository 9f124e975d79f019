use super::*;

fn batch(number: u64) -> Batch {
    let lines = 20 + number as usize % 7;
    Batch { text: format!("m value={number} {number}\n").repeat(lines).into_bytes(), points: lines as u64 }
}

fn database(number: u64) -> Database {
    Database { number, name: format!("http://{number}/write") }
}

fn open(path: &Path, limit: u64) -> Spool {
    Spool::open(path, limit, &database(1)).expect("a file").expect("nobody else has it")
}

#[test]
fn points_for_another_database_are_not_given_to_this_one() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("spool");
    open(&path, 3_000).put(&batch(0)).expect("room");
    let before = std::fs::read(&path).expect("a file");
    let refused = format!("{:#}", Spool::open(&path, 3_000, &database(2)).expect_err("another database"));
    assert!(refused.contains("20 points are in it for another database, http://1/write"), "{refused}");
    assert!(refused.contains("name another file"), "{refused}");
    assert_eq!(std::fs::read(&path).expect("a file"), before);
    // Nor is what stands behind a damaged one.
    let mut damaged = before.clone();
    damaged[HEADER_BYTES as usize + RECORD_BYTES] ^= 1;
    std::fs::write(&path, &damaged).expect("room");
    Spool::open(&path, 3_000, &database(2)).expect_err("another database");
    assert_eq!(std::fs::read(&path).expect("a file"), damaged);
    std::fs::write(&path, &before).expect("room");
    drain(&mut open(&path, 3_000));
    // An empty one is anybody's; so is one whose making was cut off.
    let mut other = Spool::open(&path, 3_000, &database(2)).expect("a file").expect("free");
    other.put(&batch(0)).expect("room");
    drop(other);
    assert!(Spool::open(&path, 3_000, &database(1)).is_err());
    std::fs::write(&path, MAGIC).expect("room");
    assert!(open(&path, 3_000).is_empty());
}

#[test]
fn a_file_that_has_lost_most_of_its_header_and_one_with_another_behind_it_are_told_and_kept() {
    for limit in [100_000, 4_000] {
        let dir = tempfile::tempdir().expect("a folder");
        let path = dir.path().join("spool");
        let mut spool = open(&path, limit);
        (0..40).for_each(|number| {
            spool.put(&batch(number)).expect("room");
        });
        let (points, expected) = (spool.points(), drain(&mut open_copy(&mut spool)));
        drop(spool);
        let whole = std::fs::read(&path).expect("a file");
        let kept = |number: usize| std::fs::read(dir.path().join(format!("hums-kept/{number}/spool")));
        for (number, bytes) in [(1, 8), (2, 40), (3, 100), (4, 511)] {
            std::fs::write(&path, &whole[..bytes]).expect("room");
            let spool = open(&path, limit);
            let points = if bytes >= NAME_AT { points } else { 0 };
            assert_eq!(spool.damage(), Damage { points, bytes: bytes as u64 });
            assert!(spool.is_empty());
            drop(spool);
            assert_eq!(kept(number).expect("it is kept"), &whole[..bytes]);
            assert_eq!(open(&path, limit).damage(), Damage::default(), "it is told once");
        }
        let joined = whole.repeat(2);
        std::fs::write(&path, &joined).expect("room");
        let mut spool = open(&path, limit);
        assert_eq!(
            spool.damage().bytes,
            if limit == 4_000 { joined.len() as u64 - 4_000 - HEADER_BYTES } else { whole.len() as u64 }
        );
        assert!(drain(&mut open_copy(&mut spool)) == expected, "{limit}");
        assert_eq!(kept(5).expect("it is kept"), joined);
    }
}

fn drain(spool: &mut Spool) -> Vec<Batch> {
    let mut taken = Vec::new();
    while let Some(batch) = spool.oldest().expect("it reads") {
        taken.push(batch);
        spool.drop_oldest().expect("it is there");
    }
    taken
}

#[test]
fn what_waits_is_found_again_in_order_wherever_the_ring_begins() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("spool");
    let mut spool = open(&path, 3_000);
    let mut number = 0;
    let mut expected = std::collections::VecDeque::new();
    for round in 0..200 {
        for _ in 0..round % 4 {
            expected.push_back(batch(number));
            let lost = spool.put(&batch(number)).expect("room");
            number += 1;
            let mut gone = 0;
            while gone < lost {
                gone += expected.pop_front().expect("it was there").points;
            }
            assert_eq!(gone, lost, "whole batches, the oldest first");
        }
        if round % 3 == 0 && !spool.is_empty() {
            assert_eq!(spool.oldest().expect("it reads"), expected.pop_front());
            spool.drop_oldest().expect("it is there");
        }
        if round % 5 == 0 {
            // As a kill leaves it.
            drop(spool);
            spool = open(&path, 3_000);
        }
        let points: u64 = expected.iter().map(|batch| batch.points).sum();
        assert_eq!((spool.points(), spool.is_empty()), (points, expected.is_empty()), "round {round}");
        assert!(path.metadata().expect("a file").len() <= 3_000 + HEADER_BYTES);
    }
    assert_eq!(drain(&mut spool), Vec::from(expected));
    assert_eq!(path.metadata().expect("a file").len(), HEADER_BYTES, "the room is given back");
}

/// As a kill leaves it while it puts this batch: the record as far as it was written, and the header not.
fn killed_in_put(path: &Path, limit: u64, batch: &Batch, less: usize) -> u64 {
    let mut spool = open(path, limit);
    let header = std::fs::read(path).expect("a file")[..HEADER_BYTES as usize].to_vec();
    assert_eq!(spool.put(batch).expect("room"), 0, "no older one goes");
    let end = spool.end;
    drop(spool);
    let mut left = std::fs::read(path).expect("a file");
    left[..header.len()].copy_from_slice(&header);
    let written = RECORD_BYTES + batch.text.len() - less;
    for at in end - less as u64..end {
        left[(HEADER_BYTES + at % limit) as usize] = 0x55;
    }
    if end < limit {
        left.truncate(left.len() - less);
    }
    std::fs::write(path, left).expect("room");
    written as u64
}

#[test]
fn a_record_that_was_cut_off_ends_it_and_those_before_are_there() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("spool");
    // In its first lap, and where the ring has begun anew.
    for limit in [100_000, 4_000] {
        let _ = std::fs::remove_file(&path);
        let mut spool = open(&path, limit);
        (0..40).for_each(|number| {
            spool.put(&batch(number)).expect("room");
        });
        (0..2).for_each(|_| spool.drop_oldest().expect("it is there"));
        let expected = drain(&mut open_copy(&mut spool));
        drop(spool);
        let whole = std::fs::read(&path).expect("a file");
        let last = RECORD_BYTES + batch(40).text.len();
        for less in [0, 1, 30, last - RECORD_BYTES, last - 10, last] {
            std::fs::write(&path, &whole).expect("room");
            let bytes = killed_in_put(&path, limit, &batch(40), less);
            let mut spool = open(&path, limit);
            let damage = match (less, last - less < RECORD_BYTES) {
                (0, _) => Damage::default(),
                // Of a record with its head its points are known; of less in a ring that has begun anew nothing is.
                (_, false) => {
                    let bytes = if limit == 4_000 { last as u64 } else { bytes };
                    Damage { points: batch(40).points, bytes }
                }
                (_, true) => Damage { points: 0, bytes: if limit == 4_000 { 0 } else { bytes } },
            };
            assert_eq!(spool.damage(), damage, "{limit}: {less} bytes less");
            let more = if less == 0 { vec![batch(40)] } else { Vec::new() };
            assert!(drain(&mut open_copy(&mut spool)) == [&expected[..], &more].concat(), "{limit} {less}");
            drop(spool);
            assert_eq!(open(&path, limit).damage(), Damage::default(), "it is told once");
            assert!(!dir.path().join("hums-kept").exists(), "it was never a batch");
        }
    }
}

#[test]
fn a_file_that_has_lost_its_end_is_damaged_and_kept() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("spool");
    let mut spool = open(&path, 100_000);
    (0..5).for_each(|number| assert_eq!(spool.put(&batch(number)).expect("room"), 0));
    drop(spool);
    let whole = std::fs::read(&path).expect("a file");
    let last = RECORD_BYTES + batch(4).text.len();
    for less in [1, last - 3, last, whole.len() - HEADER_BYTES as usize] {
        let damaged = &whole[..whole.len() - less];
        std::fs::write(&path, damaged).expect("room");
        let mut spool = open(&path, 100_000);
        let waits = if less > last { 0 } else { 4 };
        let lost = (waits..5).map(batch);
        let bytes = lost.clone().map(|batch| (RECORD_BYTES + batch.text.len()) as u64).sum();
        assert_eq!(spool.damage(), Damage { points: lost.map(|batch| batch.points).sum(), bytes }, "{less}");
        assert!(drain(&mut spool) == (0..waits).map(batch).collect::<Vec<_>>(), "{less}");
        assert!(std::fs::read(dir.path().join("hums-kept/1/spool")).expect("kept") == damaged);
        std::fs::remove_dir_all(dir.path().join("hums-kept")).expect("there");
    }
}

#[test]
fn a_file_of_an_earlier_version_is_told_as_that_and_left_as_it_is() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("spool");
    open(&path, 3_000).put(&batch(0)).expect("room");
    let mut old = std::fs::read(&path).expect("a file");
    old[8] = 2;
    std::fs::write(&path, &old).expect("room");
    let refused = format!("{:#}", Spool::open(&path, 3_000, &database(1)).expect_err("an old one"));
    assert!(refused.contains("another version of this program; move it away, or name"), "{refused}");
    assert_eq!(std::fs::read(&path).expect("a file"), old);
}

#[test]
fn what_is_sound_in_a_damaged_one_is_written_on_and_the_damaged_one_is_kept() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("spool");
    // In its first lap, and where the ring has begun anew.
    for (limit, count) in [(100_000, 12), (4_000, 40)] {
        let _ = std::fs::remove_file(&path);
        let mut spool = open(&path, limit);
        for number in 0..count {
            spool.put(&batch(number)).expect("room");
        }
        let (oldest, waits) = (spool.oldest, drain(&mut open_copy(&mut spool)));
        drop(spool);
        let whole = std::fs::read(&path).expect("a file");
        // A byte of a batch's lines, of its length, of its count, of its position; the bytes of two batches; in each batch in turn.
        for nth in 0..waits.len() {
            let bytes = |nth: usize| {
                waits[..nth].iter().map(|batch| (RECORD_BYTES + batch.text.len()) as u64).sum::<u64>()
            };
            let at = |byte: u64| (HEADER_BYTES + (oldest + bytes(nth) + byte) % limit) as usize;
            let next = bytes(nth + 1) - bytes(nth);
            let ones =
                [30..31, 1..2, 2..3, 5..6, 9..10, 17..18, 21..22, next - 1..next].map(|spoiled| (spoiled, 1));
            // The last one has none behind it.
            let twos = [next - 5..next + 3, 0..next + 30].map(|spoiled| (spoiled, 2));
            let twos = twos.into_iter().filter(|_| nth + 1 < waits.len());
            for (spoiled, lost) in ones.into_iter().chain(twos) {
                let mut damaged = whole.clone();
                spoiled.for_each(|byte| damaged[at(byte)] ^= 0x55);
                std::fs::write(&path, &damaged).expect("room");
                let spool = open(&path, limit);
                let points = waits[nth..nth + lost].iter().map(|batch| batch.points).sum();
                let damage = Damage { points, bytes: bytes(nth + lost) - bytes(nth) };
                assert_eq!(spool.damage(), damage, "{limit} {nth} {lost}");
                let sound: Vec<Batch> = [&waits[..nth], &waits[nth + lost..]].concat();
                assert_eq!(spool.points(), sound.iter().map(|batch| batch.points).sum::<u64>());
                // Also where it is killed before it has written any of it.
                drop(spool);
                let mut spool = open(&path, limit);
                assert_eq!(spool.damage(), Damage::default(), "it is told once");
                assert!(drain(&mut spool) == sound, "{limit} {nth} {lost}");
                let kept = dir.path().join("hums-kept");
                assert!(std::fs::read(kept.join("1/spool")).expect("kept") == damaged);
                std::fs::remove_dir_all(kept).expect("there");
            }
        }
        // The last one, and all of them.
        let all = HEADER_BYTES as usize..whole.len();
        for (spoiled, left) in [(whole.len() - 10..whole.len() - 9, waits.len() - 1), (all, 0)] {
            if limit > 4_000 {
                let mut damaged = whole.clone();
                damaged[spoiled].iter_mut().for_each(|byte| *byte ^= 0x55);
                std::fs::write(&path, &damaged).expect("room");
                let mut spool = open(&path, limit);
                assert!(spool.damage().bytes > 0);
                assert!(drain(&mut spool) == waits[..left]);
                assert!(std::fs::read(dir.path().join("hums-kept/1/spool")).expect("kept") == damaged);
                std::fs::remove_dir_all(dir.path().join("hums-kept")).expect("there");
            }
        }
    }
}

/// A spool with the same bytes, to be emptied in its place.
fn open_copy(spool: &mut Spool) -> Spool {
    let copy = spool.path().with_file_name("copy");
    std::fs::copy(spool.path(), &copy).expect("room");
    open(&copy, spool.limit)
}

#[test]
fn a_foreign_file_is_left_alone_and_one_in_use_is_not_shared() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("thesis.txt");
    for text in ["months of work, and much longer than a header is", "short"] {
        std::fs::write(&path, text).expect("room");
        assert!(Spool::open(&path, 3_000, &database(1)).is_err());
        assert_eq!(std::fs::read_to_string(&path).expect("a file"), text);
    }
    let path = dir.path().join("spool");
    let first = open(&path, 3_000);
    assert!(Spool::open(&path, 3_000, &database(1)).expect("a file").is_none());
    drop(first);
    open(&path, 3_000);
}

#[test]
#[cfg_attr(windows, ignore = "Wine does not rename over an open file; NTFS does")]
fn a_larger_limit_holds_from_now_on_and_what_waits_is_there() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("spool");
    let mut spool = open(&path, 3_000);
    // More than fits, so that the ring has begun anew.
    let lost: u64 = (0..20).map(|number| spool.put(&batch(number)).expect("room")).sum();
    assert!(lost > 0);
    let (points, oldest) = (spool.points(), spool.oldest().expect("it reads"));
    drop(spool);
    let mut spool = open(&path, 30_000);
    assert_eq!((spool.points(), spool.oldest().expect("it reads")), (points, oldest));
    assert!(Spool::open(&path, 30_000, &database(1)).expect("a file").is_none(), "it is in use");
    assert_eq!((20..40).map(|number| spool.put(&batch(number)).expect("room")).sum::<u64>(), 0);
    drop(spool);
    let all = drain(&mut open(&path, 30_000));
    assert!(all.ends_with(&(15..40).map(batch).collect::<Vec<_>>()[..]), "{}", all.len());
    assert_eq!(std::fs::read_dir(dir.path()).expect("a folder").count(), 1, "nothing is left beside it");
}

#[test]
fn a_limit_below_what_is_found_lets_nothing_be_added_and_nothing_be_lost() {
    let dir = tempfile::tempdir().expect("a folder");
    let path = dir.path().join("spool");
    let mut spool = open(&path, 10_000);
    (0..10).for_each(|number| assert_eq!(spool.put(&batch(number)).expect("room"), 0));
    drop(spool);
    let mut spool = open(&path, 900);
    let before = path.metadata().expect("a file").len();
    assert!(spool.is_over_limit() && !spool.has_room(&batch(10)));
    assert_eq!(spool.put(&batch(10)).expect("counted"), batch(10).points, "the new one goes");
    assert_eq!(
        (spool.points(), path.metadata().expect("a file").len()),
        ((0..10).map(|n| batch(n).points).sum(), before)
    );
    // Below the limit it counts as any other.
    for number in 0..9 {
        assert_eq!(spool.oldest().expect("it reads"), Some(batch(number)));
        spool.drop_oldest().expect("it is there");
    }
    assert!(!spool.is_over_limit() && spool.put(&batch(10)).expect("room") == 0);
    assert!(spool.put(&batch(11)).expect("room") > 0 && spool.bytes() <= 900);
    assert_eq!(drain(&mut spool).last(), Some(&batch(11)));
    spool.put(&batch(0)).expect("room");
    assert!((1..4).map(|number| spool.put(&batch(number)).expect("room")).sum::<u64>() > 0);
}

#[cfg(unix)]
#[test]
fn what_is_no_file_is_refused() {
    // A disk or a card has a length of 0 too.
    let refused =
        format!("{:#}", Spool::open(Path::new("/dev/null"), 3_000, &database(1)).expect_err("no file"));
    assert!(refused.contains("is no regular file"), "{refused}");
}

#[test]
fn one_with_a_second_name_is_not_written() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("a.spool");
    let mut spool = open(&path, 10_000);
    spool.put(&batch(1)).expect("room");
    drop(spool);
    let before = std::fs::read(&path).expect("there");
    std::fs::hard_link(&path, folder.path().join("backup")).expect("a second name");
    let refused = Spool::open(&path, 10_000, &database(1)).expect_err("it has two names");
    assert!(
        format!("{refused:#}").contains("has another name too (a hard link, of a backup perhaps)"),
        "{refused:#}"
    );
    assert_eq!(std::fs::read(&path).expect("there"), before);
}
