//! Changes of a fleet that are stopped at every step.

use std::fs::{self, File};
use std::path::Path;
use std::sync::Arc;

use parquet::basic::{LogicalType, Repetition, Type as Physical};
use parquet::data_type::{ByteArray, ByteArrayType, Int64Type};
use parquet::file::properties::WriterProperties;
use parquet::file::reader::SerializedFileReader;
use parquet::file::writer::SerializedFileWriter;
use parquet::record::RowAccessor as _;
use parquet::schema::types::Type;

use super::transaction::stop;
use super::*;
use crate::args::Compact;
use crate::identity::Identity;

const VEHICLES: [u64; 5] = [0, 2, 10, 1, 3];
pub(super) const TABLES: [&str; 3] = ["A", "B", SESSIONS];

pub(super) fn session(number: u64) -> String {
    format!("s{number:08x}-{number:024x}")
}

pub(super) fn context(fleet: &Arc<Fleet>, number: u64, date: Option<&str>, force: bool) -> Context {
    let identity = Identity {
        vehicle: format!("uid-{number:016x}"),
        date: date.map(str::to_owned),
        recording: session(number),
        ..Identity::default()
    };
    Context {
        fleet: Some(fleet.clone()),
        identity,
        inputs: Arc::new(Inputs::none().forcing(force)),
        ..Context::default()
    }
}

pub(super) fn table(file: File, vehicle: &str, session: &str, rows: std::ops::Range<i64>) {
    let field = |name, physical, logical| {
        let field = Type::primitive_type_builder(name, physical).with_repetition(Repetition::REQUIRED);
        Arc::new(field.with_logical_type(logical).build().expect("a type"))
    };
    let text = || Some(LogicalType::String);
    let fields = vec![
        field("vehicle", Physical::BYTE_ARRAY, text()),
        field("session", Physical::BYTE_ARRAY, text()),
        field("row", Physical::INT64, None),
    ];
    let schema = Arc::new(Type::group_type_builder("hums").with_fields(fields).build().expect("a schema"));
    let mut writer = SerializedFileWriter::new(file, schema, Arc::new(WriterProperties::builder().build()))
        .expect("a file");
    let mut group = writer.next_row_group().expect("a group");
    let rows: Vec<i64> = rows.collect();
    for name in [vehicle, session] {
        let names = vec![ByteArray::from(name); rows.len()];
        let mut column = group.next_column().expect("a column").expect("a column");
        column.typed::<ByteArrayType>().write_batch(&names, None, None).expect("written");
        column.close().expect("closed");
    }
    let mut column = group.next_column().expect("a column").expect("a column");
    column.typed::<Int64Type>().write_batch(&rows, None, None).expect("written");
    column.close().expect("closed");
    group.close().expect("closed");
    writer.close().expect("closed");
}

fn add(root: &Path, number: u64, date: Option<&str>, rows: i64, force: bool) -> Result<bool> {
    add_to(&Arc::new(Fleet::new(root, None)), number, date, rows, force)
}

pub(super) fn add_to(
    fleet: &Arc<Fleet>,
    number: u64,
    date: Option<&str>,
    rows: i64,
    force: bool,
) -> Result<bool> {
    let context = context(fleet, number, date, force);
    let open = Session::begin(&context)?;
    for name in TABLES {
        table(open.file(name, 1)?, &context.identity.vehicle, &session(number), 0..rows);
    }
    Ok(!matches!(open.finish(&context, rows as u64)?, Ended::Dropped))
}

pub(super) fn rows(root: &Path, table: &str) -> Vec<(String, i64)> {
    let mut all = Vec::new();
    for date in folders(&root.join(table)).expect("dates") {
        for bucket in folders(&root.join(table).join(&date)).expect("buckets") {
            let folder = root.join(table).join(&date).join(bucket);
            for name in names(&folder).expect("files").iter().filter(|name| name.ends_with(EXTENSION)) {
                let file = File::open(folder.join(name)).expect("a file");
                for row in SerializedFileReader::new(file).expect("a table") {
                    let row = row.expect("a row");
                    all.push((
                        row.get_string(1).expect("a session").clone(),
                        row.get_long(2).expect("a row"),
                    ));
                }
            }
        }
    }
    all.sort();
    all
}

pub(super) fn all_rows(root: &Path) -> Vec<Vec<(String, i64)>> {
    TABLES.iter().map(|table| rows(root, table)).collect()
}

/// As after a kill: the rest of a begun change is done by whoever comes next.
fn come_next(root: &Path) {
    stop::after(None);
    transaction::lock(root).expect("recovered");
}

#[test]
fn a_compaction_that_is_stopped_at_any_step_loses_and_doubles_no_row() {
    let mut steps = 0;
    loop {
        let dir = tempfile::tempdir().expect("a directory");
        let root = dir.path();
        for number in VEHICLES {
            assert!(add(root, number, Some("2026-05-01"), 3 + number as i64, false).expect("added"));
        }
        fs::write(root.join("A/date=2026-05-01/mine.txt"), "mine").expect("written");
        let before = all_rows(root);
        stop::after(Some(steps));
        let ended = compact::run(&Compact { folder: root.to_owned() });
        come_next(root);
        assert_eq!(all_rows(root), before, "after {steps} steps");
        add(root, 3, Some("2026-05-01"), 9, false).expect_err("it is there");
        add(root, 3, None, 9, false).expect_err("it is there, with another date");
        compact::run(&Compact { folder: root.to_owned() }).expect("compacted");
        assert_eq!(all_rows(root), before, "after {steps} steps, and again");
        add(root, 3, Some("2026-05-01"), 9, true).expect_err("it shares a file");
        // New sessions join those of an earlier compaction.
        assert!(add(root, 15, Some("2026-05-01"), 5, false).expect("added"));
        compact::run(&Compact { folder: root.to_owned() }).expect("compacted");
        let all = rows(root, "A");
        assert_eq!(all.len(), before[0].len() + 5);
        let count = |table: &str| -> usize {
            let folder = root.join(table).join("date=2026-05-01");
            folders(&folder)
                .expect("buckets")
                .iter()
                .map(|bucket| names(&folder.join(bucket)).expect("files").len())
                .sum()
        };
        let buckets = folders(&root.join("A/date=2026-05-01")).expect("buckets").len();
        assert!(TABLES.iter().all(|table| count(table) == buckets), "a file for each bucket");
        assert_eq!(fs::read(root.join("A/date=2026-05-01/mine.txt")).expect("there"), b"mine");
        if ended.is_ok() {
            break;
        }
        steps += 1;
    }
    assert!(steps > 20, "{steps}");
}

#[test]
fn a_session_that_is_replaced_is_the_old_one_or_the_new_one_after_a_stop_at_any_step() {
    let (mut steps, mut old, mut new) = (0, 0, 0);
    loop {
        let dir = tempfile::tempdir().expect("a directory");
        let root = dir.path();
        // The half log did not know the day.
        assert!(add(root, 7, None, 10, false).expect("added"));
        assert!(add(root, 8, None, 4, false).expect("added"));
        stop::after(Some(steps));
        let ended = add(root, 7, Some("2026-05-01"), 20, true);
        come_next(root);
        let counts: Vec<usize> = all_rows(root).iter().map(Vec::len).collect();
        match counts.as_slice() {
            [14, 14, 14] => old += 1,
            [24, 24, 24] => new += 1,
            _ => panic!("{counts:?} after {steps} steps"),
        }
        if ended.is_ok() {
            break;
        }
        steps += 1;
    }
    assert!(old > 1 && new > 3, "{old} {new}");
}

/// A kill while the folder of a complete change is removed.
#[test]
fn a_complete_change_is_never_applied_again_whatever_is_left_of_its_folder() {
    for gone in ["", "replaced", "compacted", "files"] {
        let dir = tempfile::tempdir().expect("a directory");
        let root = dir.path();
        assert!(add(root, 7, None, 10, false).expect("added"));
        let before = all_rows(root);
        let own = root.join(OWN);
        let left = own.join("commit-abc.hums-part");
        fs::create_dir_all(left.join("files")).expect("made");
        let file = format!("A/{}/{}", partition("uid-0000000000000007", None), file_name(&session(7), 1));
        assert!(root.join(&file).exists());
        fs::write(left.join("replaced"), format!("{file}\n")).expect("written");
        fs::write(left.join("compacted"), "").expect("written");
        match left.join(gone) {
            path if gone.is_empty() => assert!(path.exists()),
            path if path.is_dir() => fs::remove_dir(path).expect("removed"),
            path => fs::remove_file(path).expect("removed"),
        }
        assert!(add(root, 8, None, 4, false).expect("added"), "without {gone:?}");
        assert!(!left.exists(), "without {gone:?}");
        let rows = all_rows(root);
        assert!(before.iter().zip(&rows).all(|(before, rows)| rows.starts_with(before)), "without {gone:?}");
    }
}

#[test]
fn a_change_that_names_files_elsewhere_removes_none() {
    let dir = tempfile::tempdir().expect("a directory");
    let root = dir.path().join("fleet");
    assert!(add(&root, 7, None, 10, false).expect("added"));
    let (mine, inside) = (dir.path().join("mine.txt"), root.join("A/inside.txt"));
    fs::write(&mine, "mine").expect("written");
    fs::write(&inside, "inside").expect("written");
    let begun = root.join(OWN).join("commit-abc");
    for line in ["../mine.txt", mine.to_str().expect("text"), "A/../../mine.txt", ""] {
        fs::create_dir_all(begun.join("files")).expect("made");
        fs::write(begun.join("replaced"), format!("A/inside.txt\n{line}\n")).expect("written");
        fs::write(begun.join("compacted"), "").expect("written");
        let error = add(&root, 8, None, 4, false).expect_err(line);
        assert!(format!("{error:#}").contains("outside of the tables"), "{error:#}");
        assert!(mine.exists() && inside.exists(), "{line}");
    }
    fs::write(begun.join("replaced"), "A/inside.txt\n").expect("written");
    assert!(add(&root, 8, None, 4, false).expect("added"));
    assert!(mine.exists() && !inside.exists());
}

/// A row of lists has many values: memory is limited by values, not rows.
#[test]
fn a_row_group_has_so_many_values_at_most() {
    for (width, rows) in [(1, 600_000), (90, 10_000), (300_000, 3), (100_000, 7)] {
        let segments = [(0, 0, rows), (0, rows, rows / 2)];
        let groups = compact::cut(segments.map(|rows| (rows, width)).into_iter());
        for group in &groups {
            let in_group: usize = group.iter().map(|(_, _, rows)| rows).sum();
            assert!(in_group > 0 && (in_group == 1 || in_group * width <= 256 * 1024), "{width}: {group:?}");
        }
        let mut next = 0;
        for (_, from, rows) in groups.iter().flatten() {
            assert_eq!(*from, next, "in order, without a gap");
            next += rows;
        }
        assert_eq!(next, rows + rows / 2);
        assert!(groups.len() <= (next * width).div_ceil(128 * 1024) + 1, "{width}: {}", groups.len());
    }
}

#[test]
fn programs_that_add_the_same_sessions_at_once_add_each_once() {
    let dir = tempfile::tempdir().expect("a directory");
    let root = dir.path();
    let added: usize = std::thread::scope(|scope| {
        let program = |first: u64| {
            move || {
                let numbers = (0..12).map(move |number| (number + first) % 12);
                numbers.filter(|number| add(root, *number, None, 5, false).is_ok()).count()
            }
        };
        let programs: Vec<_> = (0..4).map(|first| scope.spawn(program(3 * first))).collect();
        programs.into_iter().map(|program| program.join().expect("it ends")).sum()
    });
    assert_eq!(added, 12);
    assert!(all_rows(root).iter().all(|rows| rows.len() == 60));
}

#[test]
fn the_longer_log_of_a_session_stays() {
    for order in [[10, 20], [20, 10]] {
        let dir = tempfile::tempdir().expect("a directory");
        let fleet = Arc::new(Fleet::new(dir.path(), None));
        let kept = order.map(|rows| {
            let context = context(&fleet, 1, None, false);
            let open = Session::begin(&context).expect("begun");
            for name in TABLES {
                table(open.file(name, 1).expect("a file"), "uid-1", &session(1), 0..rows);
            }
            open.finish(&context, rows as u64).expect("finished")
        });
        assert!(matches!(
            (kept, order[1]),
            ([Ended::Alone(_), Ended::Replaces(_)], 20) | ([Ended::Alone(_), Ended::Dropped], 10)
        ));
        assert!(all_rows(dir.path()).iter().all(|rows| rows.len() == 20));
    }
}

#[test]
fn the_files_of_sessions_are_known_by_their_names() {
    let session = "s1a2b3c4d-3f0042000d51373435363338";
    for part in [1, 2, 31] {
        assert_eq!(session_of(&file_name(session, part)), Some(session));
    }
    for other in
        ["mine.parquet", "s1a2b3c4d.parquet", "compact-0011.parquet", "s1a2b3c4d-3f.parquet", "a.csv"]
    {
        assert_eq!(session_of(other), None, "{other}");
    }
}

#[test]
fn vehicles_share_sixteen_buckets_evenly() {
    let mut vehicles = [0_u32; 16];
    for vehicle in 0..16_000 {
        vehicles[usize::from(bucket(&format!("uid-{vehicle:016x}")))] += 1;
    }
    assert!(vehicles.iter().all(|count| (850..1_150).contains(count)), "{vehicles:?}");
    // printf uid-0031002a3035510a | sha256sum
    assert_eq!(partition("uid-0031002a3035510a", Some("2026-11-21")), "date=2026-11-21/bucket=15");
}

#[test]
fn a_copy_without_the_folder_of_this_program_is_a_fleet() {
    let dir = tempfile::tempdir().expect("a directory");
    let root = dir.path();
    assert!(!overview::is_fleet(root));
    for number in VEHICLES {
        add(root, number, (number != 0).then_some("2026-05-01"), 1, false).expect("added");
    }
    fs::remove_dir_all(root.join(OWN)).expect("removed");
    assert!(overview::is_fleet(root) && !overview::is_fleet(&root.join(SESSIONS)));
    let overview = overview::read(root).expect("a fleet");
    assert_eq!((overview.sessions, overview.vehicles.len()), (5, 5));
    assert!(!root.join(OWN).exists(), "reading writes nothing");
}
