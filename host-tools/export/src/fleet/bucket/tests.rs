//! Programs that are stopped at every request.

use std::sync::Arc;

use tempfile::TempDir;

use super::super::Fleet;
use super::super::tests::{TABLES, add_to, all_rows, session};
use super::*;
use crate::storage::tests::{Kind, Memory};

/// Wait between two threads.
const SHORT: Duration = Duration::from_millis(5);
const NUMBERS: [u64; 2] = [0, 2];
const DAY: Option<&str> = Some("2026-05-01");

fn bucket(memory: &Arc<Memory>, patience: Duration) -> Bucket {
    let address = Address { bucket: "fleet".to_owned(), prefix: String::new() };
    Bucket::with(address, Box::new(memory.clone()), patience)
}

fn add(
    memory: &Arc<Memory>,
    patience: Duration,
    number: u64,
    date: Option<&str>,
    rows: i64,
    force: bool,
) -> Result<bool> {
    let dir = tempfile::tempdir().expect("a directory");
    let fleet = Fleet::new(dir.path(), Some(bucket(memory, patience)));
    add_to(&Arc::new(fleet), number, date, rows, force)
}

fn compact(memory: &Arc<Memory>) -> Result<Sum> {
    let mut first = None;
    let (sum, _) = bucket(memory, SHORT).compact(&mut |_, error| first = Some(format!("{error:#}")))?;
    first.map_or(Ok(sum), |error| Err(anyhow::Error::msg(error)))
}

fn stop_after(memory: &Arc<Memory>, requests: Option<u32>) {
    *memory.left.lock().expect("no panic") = requests;
}

fn folder(memory: &Arc<Memory>) -> TempDir {
    let dir = tempfile::tempdir().expect("a directory");
    for (key, bytes) in memory.objects.lock().expect("no panic").iter() {
        let path = dir.path().join(key);
        fs::create_dir_all(path.parent().expect("a folder")).expect("made");
        fs::write(path, bytes).expect("written");
    }
    dir
}

type Rows = Vec<Vec<(String, i64)>>;

fn rows(memory: &Arc<Memory>) -> Rows {
    all_rows(folder(memory).path())
}

fn filled() -> (Arc<Memory>, Rows) {
    let memory = Arc::new(Memory::default());
    for number in NUMBERS {
        assert!(add(&memory, SHORT, number, DAY, 3 + number as i64, false).expect("added"));
    }
    let rows = rows(&memory);
    (memory, rows)
}

fn copy(memory: &Arc<Memory>) -> Arc<Memory> {
    copy_as(memory, Kind::Sound)
}

fn copy_as(memory: &Arc<Memory>, kind: Kind) -> Arc<Memory> {
    let objects = memory.objects.lock().expect("no panic").clone();
    Arc::new(Memory { objects: objects.into(), kind, ..Memory::default() })
}

/// The lease of a date and bucket may stay: the next program waits once.
fn nothing_is_left(memory: &Arc<Memory>) {
    let objects = memory.objects.lock().expect("no panic");
    let left = |key: &&String| ["/lease/s", "/new/", "/commit/"].iter().any(|folder| key.contains(folder));
    let left: Vec<&String> = objects.keys().filter(left).collect();
    assert!(left.is_empty(), "{left:?}");
}

#[test]
fn a_session_whose_upload_stops_at_any_request_is_not_in_the_summary_and_is_there_once_after_the_next() {
    let (filled, before) = filled();
    let (mut steps, mut invisible) = (1, 0);
    loop {
        let memory = copy(&filled);
        stop_after(&memory, Some(steps));
        let ended = add(&memory, SHORT, 7, DAY, 10, false);
        stop_after(&memory, None);
        let now = rows(&memory);
        if now.last() == before.last() {
            invisible += 1;
        } else {
            assert!(
                now.iter().zip(&before).all(|(now, before)| now.len() == before.len() + 10),
                "after {steps}"
            );
        }
        compact(&memory).expect("compacted");
        assert!(rows(&memory) == now, "the rows of others and begun ones stay, after {steps}");
        // Also with another date: the first attempt's files go.
        let other = if steps % 2 == 0 { DAY } else { None };
        match add(&memory, SHORT, 7, other, 10, false) {
            Ok(added) => assert!(added),
            Err(error) => assert!(now.last() != before.last(), "{error:#} after {steps}"),
        }
        compact(&memory).expect("compacted");
        let all = rows(&memory);
        assert!(all.iter().zip(&before).all(|(all, before)| all.len() == before.len() + 10), "after {steps}");
        nothing_is_left(&memory);
        if ended.is_ok() {
            break;
        }
        steps += 1;
    }
    assert!(steps > 8 && invisible > 5, "{steps} {invisible}");
}

#[test]
fn a_compaction_that_stops_at_any_request_loses_and_doubles_no_row() {
    let (filled, before) = filled();
    let (mut steps, mut early) = (1, 0);
    loop {
        let memory = copy(&filled);
        memory
            .objects
            .lock()
            .expect("no panic")
            .insert("A/date=2026-05-01/mine.txt".to_owned(), b"mine".to_vec());
        stop_after(&memory, Some(steps));
        let ended = compact(&memory);
        stop_after(&memory, None);
        for (now, before) in rows(&memory).iter().zip(&before) {
            let mut once = now.clone();
            once.dedup();
            assert!(once.len() == now.len() && now.iter().all(|row| before.contains(row)), "after {steps}");
        }
        // Whoever comes next completes it.
        early += u32::from(add(&memory, SHORT, 15, DAY, 5, false).expect("added"));
        let all = rows(&memory);
        assert!(all.iter().zip(&before).all(|(all, before)| all.len() == before.len() + 5), "after {steps}");
        compact(&memory).expect("compacted");
        assert!(rows(&memory) == all, "after {steps}");
        add(&memory, SHORT, 2, None, 9, false).expect_err("it is there, with another date");
        add(&memory, SHORT, 2, DAY, 9, true).expect_err("it shares a file");
        assert!(rows(&memory) == all, "after {steps}");
        let files = |table: &&str| {
            let folder = format!("{table}/date=2026-05-01/bucket");
            memory.objects.lock().expect("no panic").keys().filter(|key| key.starts_with(&folder)).count()
        };
        assert!(TABLES.iter().map(files).all(|count| count <= 2), "a file for each bucket");
        nothing_is_left(&memory);
        assert_eq!(compact(&memory).expect("compacted").sessions, 0);
        if ended.is_ok() {
            break;
        }
        steps += 1;
    }
    assert!(steps > 25 && early > 25, "{steps} {early}");
}

#[test]
fn a_replaced_session_is_never_in_the_summary_twice_and_is_the_new_one_after_the_next() {
    let (filled, before) = filled();
    // The half log did not know the day.
    assert!(add(&filled, SHORT, 7, None, 10, false).expect("added"));
    let mut steps = 1;
    loop {
        let memory = copy(&filled);
        stop_after(&memory, Some(steps));
        let ended = add(&memory, SHORT, 7, DAY, 20, true);
        stop_after(&memory, None);
        let now = rows(&memory);
        let of =
            |rows: &Rows| rows.last().map_or(0, |rows| rows.iter().filter(|row| row.0 == session(7)).count());
        assert!([0, 10, 20].contains(&of(&now)), "{} after {steps}", of(&now));
        let again = add(&memory, SHORT, 7, DAY, 20, true).expect("it may be replaced");
        let all = rows(&memory);
        assert!(
            again && all.iter().zip(&before).all(|(all, before)| all.len() == before.len() + 20),
            "after {steps}"
        );
        nothing_is_left(&memory);
        if ended.is_ok() {
            break;
        }
        steps += 1;
    }
    assert!(steps > 12, "{steps}");
}

#[test]
fn programs_that_add_the_same_sessions_at_once_add_each_once() {
    let memory = Arc::new(Memory::default());
    // Longer than a busy computer stops a thread.
    let patience = Duration::from_secs(18);
    let added: usize = thread::scope(|scope| {
        let program = |first: u64| {
            let memory = &memory;
            move || {
                let numbers = (0..6).map(move |number| (number + first) % 6);
                // Each program knows another date.
                let date = ["2026-05-01", "2026-05-02"].get(first as usize % 2).copied();
                numbers.filter(|number| add(memory, patience, *number, date, 5, false).is_ok()).count()
            }
        };
        let programs: Vec<_> = (0..4).map(|first| scope.spawn(program(first))).collect();
        programs.into_iter().map(|program| program.join().expect("it ends")).sum()
    });
    assert_eq!(added, 6);
    assert!(rows(&memory).iter().all(|rows| rows.len() == 30));
    nothing_is_left(&memory);
}

#[test]
fn the_holder_of_a_lease_that_was_taken_over_does_nothing_more() {
    let memory = Arc::new(Memory::default());
    let places = vec!["A/date=2026-05-01/bucket=01/a.parquet".to_owned()];
    let (slow, next) = (bucket(&memory, SHORT), bucket(&memory, SHORT));
    let old = slow.lease("session", &places, None).expect("free");
    // It waits until the first one has not renewed it for long.
    let new = next.lease("session", &[], None).expect("taken over");
    assert_eq!(new.left, places.iter().cloned().collect());
    let before = memory.objects.lock().expect("no panic").clone();
    let error = old.delete(&places).expect_err("it is taken over").to_string();
    assert!(error.contains("taken over"), "{error}");
    old.keep().expect_err("for ever");
    drop(old);
    assert!(*memory.objects.lock().expect("no panic") == before);
    // A failed program frees its lease and keeps its list, so no program waits.
    drop(new);
    let patient = bucket(&memory, Duration::from_hours(1));
    let last = patient.lease("session", &[], None).expect("free");
    assert_eq!(last.left, places.into_iter().collect());
    last.end().expect("ended");
    assert!(memory.objects.lock().expect("no panic").is_empty());
}

#[test]
fn a_lease_is_kept_while_its_program_waits_for_another_one() {
    let memory = Arc::new(Memory::default());
    memory.objects.lock().expect("no panic").insert(own("lease", "part"), b"stopped 0\n".to_vec());
    let bucket = bucket(&memory, SHORT);
    let outer = bucket.lease("session", &[], None).expect("free");
    bucket.lease("part", &[], Some(&outer)).expect("taken over").end().expect("ended");
    let text = memory.objects.lock().expect("no panic").get(&own("lease", "session")).cloned();
    assert!(text.is_some_and(|text| !text.ends_with(b" 0\n")), "it was not renewed");
    outer.end().expect("ended");
}

#[test]
fn a_list_of_sessions_that_are_not_complete_takes_no_lease() {
    let (memory, _) = filled();
    let programs = bucket(&memory, Duration::from_hours(1));
    let (replaced, new) = (session(NUMBERS[0]), session(7));
    let leases = [&replaced, &new].map(|session| programs.lease(session, &[], None).expect("free"));
    let before = memory.objects.lock().expect("no panic").clone();
    assert_eq!(programs.leased(false).expect("listed"), [new]);
    assert_eq!(programs.leased(true).expect("listed"), [replaced]);
    assert!(*memory.objects.lock().expect("no panic") == before);
    drop(leases);
}

#[test]
fn a_program_whose_answers_are_lost_waits_for_no_lease_of_its_own() {
    let (filled, before) = filled();
    let memory = copy_as(&filled, Kind::Repeated);
    let patience = Duration::from_hours(1);
    assert!(add(&memory, patience, 7, DAY, 10, false).expect("added"));
    assert!(add(&memory, patience, 7, DAY, 20, true).expect("replaced"));
    let (sum, _) = bucket(&memory, patience).compact(&mut |_, error| panic!("{error:#}")).expect("compacted");
    assert_eq!(sum.sessions, 3);
    assert!(rows(&memory).iter().zip(&before).all(|(all, before)| all.len() == before.len() + 20));
    nothing_is_left(&memory);
}

#[test]
fn a_session_that_another_program_began_to_replace_is_added_again() {
    let (memory, before) = filled();
    let dir = tempfile::tempdir().expect("a directory");
    let fleet = Arc::new(Fleet::new(dir.path(), Some(bucket(&memory, SHORT))));
    assert!(add_to(&fleet, 7, DAY, 10, false).expect("added"));
    let whole = memory.objects.lock().expect("no panic").clone();
    let mut steps = 1;
    while memory.objects.lock().expect("no panic").contains_key(&own("index", &session(7))) {
        memory.objects.lock().expect("no panic").clone_from(&whole);
        stop_after(&memory, Some(steps));
        add(&memory, SHORT, 7, None, 20, true).expect_err("stopped");
        stop_after(&memory, None);
        steps += 1;
    }
    assert!(add_to(&fleet, 7, DAY, 10, false).expect("added"));
    assert!(rows(&memory).iter().zip(&before).all(|(all, before)| all.len() == before.len() + 10));
    nothing_is_left(&memory);
}

#[test]
fn a_server_without_conditional_writes_is_refused() {
    for kind in [Kind::NoneMatches, Kind::AllMatch] {
        let memory = copy_as(&Arc::default(), kind);
        let error = add(&memory, SHORT, 7, DAY, 1, false).expect_err("unsafe").to_string();
        assert!(error.contains("no conditional writes"), "{kind:?}: {error}");
        assert!(memory.objects.lock().expect("no panic").is_empty(), "{kind:?}");
    }
}

#[test]
fn tables_that_were_copied_there_and_a_commit_of_others_are_refused() {
    let (memory, _) = filled();
    let here = folder(&memory);
    let fleet = Arc::new(Fleet::new(here.path(), None));
    let error = add_to(&fleet, 7, DAY, 1, false).expect_err("copied here").to_string();
    assert!(error.contains("a copy of object storage"), "{error}");
    memory.objects.lock().expect("no panic").retain(|key, _| !key.starts_with(OWN));
    let before = memory.objects.lock().expect("no panic").clone();
    let error = add(&memory, SHORT, 7, DAY, 1, false).expect_err("unknown sessions").to_string();
    assert!(error.contains("were copied there"), "{error}");
    let error = compact(&memory).expect_err("unknown sessions").to_string();
    assert!(error.contains("has no tables of hums"), "{error}");
    assert!(*memory.objects.lock().expect("no panic") == before);
    let (memory, before) = filled();
    let commit = format!("{OWN}/commit/date=2026-05-01,bucket=00");
    memory.objects.lock().expect("no panic").insert(commit, b"-../mine\n".to_vec());
    let error = format!("{:#}", add(&memory, SHORT, 7, DAY, 1, false).expect_err("outside"));
    assert!(error.contains("outside of the tables") && rows(&memory) == before, "{error}");
}
