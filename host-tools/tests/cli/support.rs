//! Shared parts of the program's tests.

use std::collections::BTreeMap;
use std::fs;
use std::io::Write as _;
use std::os::unix::fs::{FileExt as _, MetadataExt as _, symlink};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::{Arc, Mutex, OnceLock};
use std::time::{Duration, Instant};

use tempfile::TempDir;

pub(crate) fn flight(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/flights").join(name)
}

pub(crate) fn px4() -> PathBuf {
    flight("px4_hil_quad_low.tlog")
}

pub(crate) fn records(mut rest: &[u8]) -> Vec<(u64, &[u8])> {
    const TIME_BYTES: usize = 8;
    let mut records = Vec::new();
    while let Some((time, frame)) =
        rest.split_first_chunk::<TIME_BYTES>().filter(|(_, frame)| frame.len() > 2)
    {
        // MAVLink 2 and 1: header, payload, checksum; a signature if the header has its flag.
        let (head, signature) = if frame[0] == 0xFD { (12, 13 * usize::from(frame[2] & 1)) } else { (8, 0) };
        let (frame, after) = frame.split_at((head + usize::from(frame[1]) + signature).min(frame.len()));
        records.push((u64::from_be_bytes(*time), frame));
        rest = after;
    }
    records
}

pub(crate) fn end_of(name: &str, folder: &Path) -> PathBuf {
    let log = fs::read(flight(name)).expect("a recording");
    let records = records(&log);
    let end = &records[records.len() / 5 * 4..];
    let path = folder.join(name);
    let bytes: Vec<u8> = end.iter().flat_map(|(us, frame)| [&us.to_be_bytes()[..], frame].concat()).collect();
    fs::write(&path, bytes).expect("written");
    path
}

pub(crate) fn hums() -> Command {
    let mut command = Command::new("timeout");
    command.args(["60", env!("CARGO_BIN_EXE_hums")]);
    command
}

/// With these bytes on a pipe.
pub(crate) fn piped(command: &mut Command, input: &[u8]) -> Output {
    let command = command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().expect("it runs");
    let mut stdin = child.stdin.take().expect("a pipe");
    std::thread::scope(|scope| {
        scope.spawn(move || stdin.write_all(input));
        child.wait_with_output().expect("it ends")
    })
}

/// The output; the exit code must be this one.
#[track_caller]
pub(crate) fn run(dir: &Path, line: &str, code: i32) -> Output {
    let output = attempt(dir, line);
    let error = stderr(&output);
    assert_eq!(output.status.code(), Some(code), "hums {line}\n{error}");
    output
}

/// The output, with any exit code.
#[track_caller]
pub(crate) fn attempt(dir: &Path, line: &str) -> Output {
    let arguments = line.split_whitespace().map(|word| match word {
        "PX4" => px4().display().to_string(),
        word => word.to_owned(),
    });
    let output = hums().current_dir(dir).args(arguments).output().expect("it runs");
    let error = String::from_utf8_lossy(&output.stderr);
    assert!(!error.contains("panicked"), "hums {line}\n{error}");
    output
}

pub(crate) fn text(output: &Output) -> String {
    String::from_utf8_lossy(&output.stdout).into_owned()
}

pub(crate) fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

pub(crate) fn json(output: &Output) -> serde_json::Value {
    serde_json::from_slice(&output.stdout).expect("one JSON object")
}

pub(crate) fn recorded() -> TempDir {
    made_once("recorded", |dir| {
        run(dir, "sim PX4 --sd card.img --card-size 64", 0);
    })
}

/// A file that is made once. A card is nearly empty, so only its used parts are stored.
struct Made {
    name: String,
    long: u64,
    /// Their offsets, and their bytes.
    parts: Vec<(u64, Vec<u8>)>,
}

impl Made {
    fn of((name, bytes): (String, Vec<u8>)) -> Self {
        const PART: usize = 4_096;
        let parts = (0..).step_by(PART).zip(bytes.chunks(PART));
        let parts = parts.filter(|(_, part)| **part != [0; PART][..part.len()]);
        Self { name, long: bytes.len() as u64, parts: parts.map(|(at, part)| (at, part.to_vec())).collect() }
    }

    fn write(&self, dir: &Path) {
        let path = dir.join(&self.name);
        fs::create_dir_all(path.parent().expect("a folder")).expect("made");
        let file = fs::File::create(path).expect("a file");
        for (at, part) in &self.parts {
            file.write_all_at(part, *at).expect("written");
        }
        file.set_len(self.long).expect("as long as it was");
    }
}

pub(crate) fn made_once(what: &str, make: impl FnOnce(&Path)) -> TempDir {
    static MADE: Mutex<BTreeMap<String, Arc<OnceLock<Vec<Made>>>>> = Mutex::new(BTreeMap::new());
    let slot = MADE.lock().expect("nothing fails under it").entry(what.to_owned()).or_default().clone();
    let files = slot.get_or_init(|| {
        let dir = tempfile::tempdir().expect("directory");
        make(dir.path());
        contents(dir.path()).into_iter().map(Made::of).collect()
    });
    let dir = tempfile::tempdir().expect("directory");
    for file in files {
        file.write(dir.path());
    }
    dir
}

pub(crate) fn frames(tlog: &[u8]) -> Vec<Vec<u8>> {
    records(tlog).into_iter().map(|(_, frame)| frame.to_vec()).collect()
}

pub(crate) fn frames_of(path: &Path) -> Vec<Vec<u8>> {
    frames(&fs::read(path).expect("a recording"))
}

/// The name of the log `base` in a directory (`00001`, or a packed log's own name), with box and session. There must
/// be one such log.
#[track_caller]
pub(crate) fn named(dir: &Path, base: &str) -> String {
    let names = all_named(dir, base);
    assert_eq!(names.len(), 1, "{base} in {}: {names:?}", dir.display());
    names[0].clone()
}

pub(crate) fn all_named(dir: &Path, base: &str) -> Vec<String> {
    let entries = fs::read_dir(dir).expect("a directory").map(|entry| entry.expect("an entry").file_name());
    let mut names: Vec<String> = entries
        .filter_map(|name| {
            let name = name.into_string().expect("UTF-8");
            let session = base.len() + name.get(base.len()..)?.find("-s")?;
            let end = session + "-s1a2b3c4d".len();
            (name.starts_with(base) && name.len() >= end).then(|| name[..end].to_owned())
        })
        .collect();
    names.sort();
    names.dedup();
    names
}

pub(crate) fn furnished() -> TempDir {
    let dir = tempfile::tempdir().expect("directory");
    let at = |name: &str| dir.path().join(name);
    fs::rename(end_of("px4_hil_quad_low.tlog", dir.path()), at("flight.tlog")).expect("renamed");
    run(dir.path(), "decode --format hum flight.tlog -o log.hum", 0);
    fs::write(at("hums.param"), "CELL_VOLT_WARN 3.6\n").expect("a file");
    fs::write(at("key.txt"), "00112233445566778899aabbccddeeff00112233445566778899aabbccddeeff\n")
        .expect("a file");
    let mut elf = b"\x7fELF".to_vec();
    elf.resize(64, 0);
    elf[18] = 40;
    fs::write(at("hums.elf"), elf).expect("a file");
    fs::create_dir(at("folder")).expect("a directory");
    for name in ["flight.tlog", "log.hum", "hums.param", "key.txt", "hums.elf"] {
        symlink(name, at(&format!("link-{name}"))).expect("a link");
        fs::hard_link(at(name), at(&format!("hard-{name}"))).expect("a link");
        fs::copy(at(name), at("folder").join(name)).expect("a copy");
    }
    dir
}

pub(crate) fn contents(dir: &Path) -> Vec<(String, Vec<u8>)> {
    each_file(dir, |path| fs::read(path).expect("a file"))
}

/// Identity, length and time of the last change (`st_ctime`, which no program sets): with the same values a file is
/// untouched.
pub(crate) type Stamp = (u64, u64, i64, i64);

pub(crate) fn stamps(dir: &Path) -> Vec<(String, Stamp)> {
    each_file(dir, |path| {
        let of = fs::metadata(path).expect("a file");
        (of.ino(), of.len(), of.ctime(), of.ctime_nsec())
    })
}

fn each_file<T: Ord>(dir: &Path, of: impl Fn(&Path) -> T + Copy) -> Vec<(String, T)> {
    let mut found = Vec::new();
    let entries = fs::read_dir(dir).expect("a directory");
    for path in entries.map(|entry| entry.expect("an entry").path()) {
        let name = path.file_name().expect("a name").to_string_lossy().into_owned();
        if path.is_dir() {
            let inner = each_file(&path, of).into_iter();
            found.extend(inner.map(|(inner, of)| (format!("{name}/{inner}"), of)));
        } else {
            found.push((name, of(&path)));
        }
    }
    found.sort();
    found
}

#[track_caller]
pub(crate) fn until(what: &str, is: impl Fn() -> bool) {
    let limit = Instant::now() + Duration::from_secs(30);
    while !is() {
        assert!(Instant::now() < limit, "{what}");
        std::thread::sleep(Duration::from_millis(1));
    }
}
