//! `hums compact`: every value of every table is there afterwards, once, also after kills.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use parquet::basic::ConvertedType as Of;
use parquet::basic::Encoding::BYTE_STREAM_SPLIT;
use parquet::file::metadata::RowGroupMetaData;
use parquet::file::reader::{FileReader as _, SerializedFileReader};

use super::support::{contents, px4, run, stderr, text};

fn rows(fleet: &Path) -> BTreeMap<String, Vec<String>> {
    let mut tables: BTreeMap<String, Vec<String>> = BTreeMap::new();
    for (name, _) in contents(fleet) {
        if name.starts_with('.') || !name.ends_with(".parquet") {
            continue;
        }
        let table = name.split('/').next().expect("a table").to_owned();
        let file = File::open(fleet.join(&name)).expect("a file");
        let reader = SerializedFileReader::new(file).expect("a table");
        // Spark does not read these.
        for column in reader.metadata().row_groups().iter().flat_map(RowGroupMetaData::columns) {
            let is_large = matches!(column.column_descr().converted_type(), Of::UINT_32 | Of::UINT_64);
            assert!(!is_large || column.encodings().all(|encoding| encoding != BYTE_STREAM_SPLIT), "{name}");
        }
        let rows = reader.into_iter().map(|row| row.expect("a row").to_string());
        tables.entry(table).or_default().extend(rows);
    }
    for rows in tables.values_mut() {
        rows.sort_unstable();
    }
    tables
}

fn files(fleet: &Path) -> usize {
    contents(fleet).iter().filter(|(name, _)| !name.starts_with('.') && name.ends_with(".parquet")).count()
}

fn fleet() -> tempfile::TempDir {
    let dir = tempfile::tempdir().expect("directory");
    run(dir.path(), "decode --format hum PX4 -o log.hum", 0);
    let tlog = fs::read(px4()).expect("a recording");
    fs::write(dir.path().join("few.tlog"), &tlog[..100_000]).expect("written");
    run(dir.path(), "decode log.hum few.tlog -o fleet --format parquet", 0);
    dir
}

#[test]
fn every_value_is_there_once_also_after_kills() {
    let dir = fleet();
    let at = dir.path().join("fleet");
    let before = rows(&at);
    assert!(before.len() > 40 && before["ATTITUDE"].len() > 1_000, "{}", before.len());
    let (many, mut killed) = (files(&at), 0);
    for after_ms in (0..400).step_by(40) {
        let mut program = Command::new(env!("CARGO_BIN_EXE_hums"))
            .args(["compact", "fleet"])
            .current_dir(dir.path())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("it runs");
        std::thread::sleep(Duration::from_millis(after_ms));
        program.kill().expect("it is ours");
        killed += u32::from(!program.wait().expect("it is ours").success());
    }
    let said = run(dir.path(), "compact fleet", 0);
    assert!(killed > 0 && text(&said).starts_with("fleet: "), "{killed} {}", text(&said));
    assert!(rows(&at) == before, "rows differ");
    assert!(contents(&at).iter().all(|(name, _)| !name.contains(".hums-part")));
    assert!(files(&at) <= before.len() && files(&at) < many, "{} of {many}", files(&at));
    assert!(text(&run(dir.path(), "compact fleet", 0)).contains("0 sessions"));
    let again = run(dir.path(), "decode few.tlog -o fleet --format parquet --force", 1);
    assert!(String::from_utf8_lossy(&again.stderr).contains("in a file of several sessions"));
    run(dir.path(), "compact .", 2);
}

#[test]
fn other_files_stay_and_a_damaged_one_leaves_its_day_as_it_is() {
    let dir = fleet();
    let at = dir.path().join("fleet");
    let (name, _) =
        contents(&at).into_iter().find(|(name, _)| name.starts_with("ATTITUDE/")).expect("a file");
    let folder = at.join(Path::new(&name).parent().expect("a folder"));
    fs::write(folder.join("notes.txt"), "mine").expect("written");
    let bytes = fs::read(at.join(&name)).expect("a file");
    fs::write(at.join(&name), &bytes[..bytes.len() / 2]).expect("written");
    let before = contents(&at);
    let said = stderr(&run(dir.path(), "compact fleet", 1));
    assert!(
        said.contains("notes.txt: is not of hums") && said.contains("cannot be read as a table"),
        "{said}"
    );
    let left = |all: Vec<(String, Vec<u8>)>| -> Vec<(String, Vec<u8>)> {
        all.into_iter().filter(|(name, _)| !name.starts_with('.')).collect()
    };
    assert!(left(contents(&at)) == left(before), "something was changed");
    fs::write(at.join(&name), &bytes).expect("written");
    run(dir.path(), "compact fleet", 0);
    assert_eq!(fs::read(folder.join("notes.txt")).expect("there"), b"mine");
}
