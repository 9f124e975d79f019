//! Real flights: recordings of vehicles, with labels by people who read the data.
//!
//! A folder of real flights has tables `labels*.csv` with a header, or none, and the name of a folder in `tests/real-flights` that has.
//! Other columns than these are ignored:
//!
//! | column | in the row of a flight | in the row of a finding |
//! |---|---|---|
//! | `file` | the recording, relative to the folder | the same |
//! | `check` | empty | the check's name |
//! | `instance` | empty | which one of several, 0 to 255; empty is 0 |
//! | `onset` | when the known fault began | when the level rose; as `time_s` of `hums check --json`; empty is the beginning |
//! | `label` | `flight` | `true`, `needless` (true, and no pilot, mechanic or owner would act on it) or `false` |
//! | `cause` | the class of the known fault ([`super::causes::CLASSES`]); empty for an ordinary flight | the evidence |
//!
//! Recordings without a row of the flight are not judged. A label holds for one rise: the first of its check and
//! instance since [`EARLIER_S`] before its onset. A later rise needs a label of its own.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail, ensure};
use hums::check::judge::{HeardAt, Limits};
use hums::check::judged::Judgement;
use hums::names::vocabulary;
use hums::source::recording::LogPlace;
use hums_core::health::Level;
use rayon::prelude::*;

use super::causes::{self, Class};
use super::judged::{Judged, with_label};
use super::options::Known;
use super::outcome::count;
use super::rates::{an_hour, hours, share};
use super::table::{Form, records};
use crate::flights::root;

/// Tolerance of a finding before its label, in seconds: a check may have become faster.
const EARLIER_S: f64 = 10.0;

const TABLE: (&str, &str) = ("labels", ".csv");

/// Tables of public recordings, by the name of the folder that has these.
const LABELS: &str = "tests/real-flights";

const COLUMNS: [&str; 6] = ["file", "check", "instance", "onset", "label", "cause"];

pub(super) const RATES: Form = Form {
    title: "Real flights",
    about: "Texts to the pilot, as a box in the vehicle had selected and sent them, in the words of the cause if that was known. Rates are per armed hour, \
            without unlabelled findings. A needless finding is true, but no pilot, mechanic or owner would act on it. Fault first: of so many known \
            faults the first text to the pilot was of the failed part. Hours of simulators are in the air without a fault; each alarm in them is false.",
    columns: &[
        "flights",
        "judged",
        "recordings",
        "hours",
        "level",
        "true",
        "needless",
        "false",
        "unlabelled",
        "false an hour",
        "at most",
        "needless an hour",
        "at most",
        "fault first",
    ],
};

pub(super) const EACH: Form = Form {
    title: "Each finding of a real flight",
    about: "Except true ones.",
    columns: &["recording", "check", "instance", "level", "at s", "label", "evidence"],
};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Verdict {
    True,
    Needless,
    False,
    Unlabelled,
}

impl Verdict {
    const ALL: [Self; 4] = [Self::True, Self::Needless, Self::False, Self::Unlabelled];

    const fn name(self) -> &'static str {
        match self {
            Self::True => "true",
            Self::Needless => "needless",
            Self::False => "false",
            Self::Unlabelled => "unlabelled",
        }
    }

    fn parse(word: &str) -> Result<Self> {
        let mut labels = Self::ALL.into_iter().filter(|one| *one != Self::Unlabelled);
        labels.find(|one| one.name() == word).with_context(|| format!("{word} is no label of a finding"))
    }
}

#[derive(Clone, Copy, Debug)]
struct Fault {
    class: &'static Class,
    onset_s: f64,
}

#[derive(Clone, Debug)]
struct Label {
    onset_s: f64,
    verdict: Verdict,
    evidence: String,
}

#[derive(Debug)]
struct Flight {
    path: PathBuf,
    name: String,
    fault: Option<Fault>,
    labels: BTreeMap<(String, u8), Vec<Label>>,
}

/// Takes the label of a rise: of those that hold, the one with the nearest onset. Labels before it are stale.
fn take<'a>(labels: &mut &'a [Label], at_s: f64) -> Option<&'a Label> {
    let holding = labels.iter().enumerate().filter(|(_, label)| label.onset_s - EARLIER_S <= at_s);
    let distance_s = |label: &Label| (label.onset_s - at_s).abs();
    let (place, label) =
        holding.min_by(|(_, one), (_, other)| distance_s(one).total_cmp(&distance_s(other)))?;
    *labels = &labels[place + 1..];
    Some(label)
}

#[derive(Debug)]
pub(super) struct Set {
    name: String,
    known: Known,
    flights: Vec<Flight>,
}

/// A finding that the pilot receives.
#[derive(Debug)]
struct Told {
    check: String,
    instance: u8,
    level: Level,
    at_s: f64,
    verdict: Verdict,
    evidence: String,
}

#[derive(Debug)]
struct Outcome {
    name: String,
    armed_s: f64,
    /// Of a known fault, whether the first that a pilot hears is of the part that failed.
    right_first: Option<bool>,
    told: Vec<Told>,
}

#[derive(Debug)]
pub(super) struct Results {
    name: String,
    known: Known,
    outcomes: Vec<Outcome>,
}

pub(super) fn find(folder: &Path, known: Known) -> Result<Option<Set>> {
    let name = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
    let name = name.file_name().map_or_else(|| "given".into(), |name| name.to_string_lossy().into_owned());
    let ours = root().join(LABELS).join(&name);
    let tables = match tables(folder)? {
        none if none.is_empty() && ours.is_dir() => tables(&ours)?,
        own => own,
    };
    let mut flights = BTreeMap::new();
    for table in &tables {
        let text = fs::read_to_string(table).with_context(|| table.display().to_string())?;
        read(folder, &text, &mut flights).with_context(|| table.display().to_string())?;
    }
    let set = Set { name, known, flights: flights.into_values().collect() };
    Ok(Some(set).filter(|_| !tables.is_empty()))
}

fn tables(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut tables = Vec::new();
    for entry in fs::read_dir(folder).with_context(|| folder.display().to_string())? {
        let entry = entry.with_context(|| folder.display().to_string())?;
        let name = entry.file_name().to_string_lossy().into_owned();
        if name.starts_with(TABLE.0) && name.ends_with(TABLE.1) {
            tables.push(entry.path());
        }
    }
    tables.sort();
    Ok(tables)
}

fn read(folder: &Path, text: &str, flights: &mut BTreeMap<String, Flight>) -> Result<()> {
    let mut rows = records(text)?.into_iter();
    let header = rows.next().context("the table is empty")?;
    let place = |column: &str| {
        header.iter().position(|name| name == column).with_context(|| format!("no column {column}"))
    };
    let places = COLUMNS.iter().map(|column| place(column)).collect::<Result<Vec<_>>>()?;
    for (number, row) in (2..).zip(rows) {
        let cells: Vec<&str> =
            places.iter().map(|place| row.get(*place).map_or("", String::as_str)).collect();
        let [file, check, instance, onset, label, cause] = cells[..] else { bail!("a row has no cells") };
        let context = || format!("row {number}, {file}");
        let or_zero = |cell: &str| if cell.is_empty() { "0".to_owned() } else { cell.to_owned() };
        let onset_s =
            or_zero(onset).parse::<f64>().with_context(|| format!("{}: onset {onset}", context()))?;
        ensure!(onset_s.is_finite(), "{}: onset {onset} is no time", context());
        if label == "flight" {
            ensure!(check.is_empty(), "{}: the row of a flight names a check", context());
            let class = causes::of(cause);
            ensure!(cause.is_empty() || class.is_some(), "{}: no class {cause}", context());
            let fault = class.map(|class| Fault { class, onset_s });
            let (path, name) = (folder.join(file), file.to_owned());
            ensure!(path.is_file(), "{}: no such recording", context());
            let flight = Flight { path, name, fault, labels: BTreeMap::new() };
            let double = flights.insert(file.to_owned(), flight).is_some();
            ensure!(!double, "{}: the flight has two rows", context());
        } else {
            let flight =
                flights.get_mut(file).with_context(|| format!("{}: the flight has no row", context()))?;
            ensure!(vocabulary(check).is_some(), "{}: there is no check {check}", context());
            let instance = or_zero(instance)
                .parse::<u8>()
                .with_context(|| format!("{}: instance {instance}", context()))?;
            let verdict = Verdict::parse(label).with_context(context)?;
            let labels = flight.labels.entry((check.to_owned(), instance)).or_default();
            labels.push(Label { onset_s, verdict, evidence: cause.to_owned() });
            labels.sort_by(|one, other| one.onset_s.total_cmp(&other.onset_s));
        }
    }
    Ok(())
}

pub(super) fn judge(set: &Set) -> Result<Results> {
    let outcomes = set.flights.par_iter().with_max_len(1).map(|flight| {
        let place = LogPlace::file(&flight.path);
        let recording = hums::check::recording(&place, &Limits::default(), HeardAt::Somewhere);
        Ok(of(flight, &recording.with_context(|| flight.name.clone())?.judged))
    });
    Ok(Results { name: set.name.clone(), known: set.known, outcomes: outcomes.collect::<Result<_>>()? })
}

fn of(flight: &Flight, judged: &Judgement) -> Outcome {
    let mut labels: BTreeMap<_, _> =
        flight.labels.iter().map(|(of, labels)| (of, labels.as_slice())).collect();
    let told = judged.told.iter().map(|told| {
        let since_s = told.since.as_secs_f64();
        let labels = labels.get_mut(&(told.check.clone(), told.instance));
        let label = labels.and_then(|labels| take(labels, since_s));
        Told {
            check: told.check.clone(),
            instance: told.instance,
            level: told.level,
            at_s: since_s,
            verdict: label.map_or(Verdict::Unlabelled, |label| label.verdict),
            evidence: label.map_or_else(String::new, |label| label.evidence.clone()),
        }
    });
    Outcome {
        name: flight.name.clone(),
        armed_s: judged.armed.as_millis() as f64 / 1e3,
        right_first: flight.fault.map(|Fault { class, onset_s }| {
            let first = judged.told.iter().find(|told| onset_s - EARLIER_S <= told.at.as_secs_f64());
            first.is_some_and(|first| class.checks.contains(&first.check.as_str()))
        }),
        told: told.collect(),
    }
}

const fn judged_when(known: Known) -> &'static str {
    match known {
        Known::No => "once",
        Known::Yes | Known::Seen => "often",
    }
}

pub(super) fn rates(real: &[Results], sets: &[Judged]) -> Vec<Vec<String>> {
    let levels = [(Level::Warning, "warning"), (Level::Critical, "critical")];
    let mut rows = Vec::new();
    for set in real {
        let armed_s = set.outcomes.iter().map(|one| one.armed_s).sum::<f64>();
        let right = right_first(set.outcomes.iter().filter_map(|one| one.right_first));
        for (level, name) in levels {
            let of = |wanted| {
                let told = set.outcomes.iter().flat_map(|one| &one.told);
                told.filter(|one| one.level == level && one.verdict == wanted).count() as u64
            };
            let mut row = head(&set.name, judged_when(set.known), set.outcomes.len(), armed_s, name);
            row.extend(Verdict::ALL.map(|wanted| of(wanted).to_string()));
            row.extend(an_hour(of(Verdict::False), armed_s));
            row.extend(an_hour(of(Verdict::Needless), armed_s));
            row.push(right.clone());
            rows.push(row);
        }
    }
    for (known, name) in [(Known::Yes, "often"), (Known::No, "once")] {
        let flown: Vec<_> =
            with_label(sets, true).filter(|set| set.known == known).flat_map(|set| &set.outcomes).collect();
        if flown.is_empty() {
            continue;
        }
        let air_s = flown.iter().map(|one| one.air_s).sum::<f64>();
        let faults = flown.iter().filter_map(|one| one.fault.as_ref()).filter(|fault| fault.visible);
        let right = right_first(faults.map(|fault| fault.right_first));
        for (level, level_name) in levels {
            let alarms = count(flown.iter().flat_map(|one| &one.alarms), level, true);
            let mut row = head("simulators", name, flown.len(), air_s, level_name);
            row.extend(["-".to_owned(), "-".to_owned(), alarms.to_string(), "-".to_owned()]);
            row.extend(an_hour(alarms, air_s));
            row.extend(["-".to_owned(), "-".to_owned(), right.clone()]);
            rows.push(row);
        }
    }
    rows
}

fn head(name: &str, judged: &str, recordings: usize, seconds: f64, level: &str) -> Vec<String> {
    vec![name.to_owned(), judged.to_owned(), recordings.to_string(), hours(seconds), level.to_owned()]
}

fn right_first(faults: impl Iterator<Item = bool>) -> String {
    let faults: Vec<bool> = faults.collect();
    let (right, all) = (faults.iter().filter(|is_right| **is_right).count(), faults.len());
    let [part, least] = share(right as u64, all as u64);
    format!("{right} of {all} ({part}, at least {least})")
}

pub(super) fn each(real: &[Results]) -> Vec<Vec<String>> {
    let mut rows = Vec::new();
    for outcome in real.iter().flat_map(|set| &set.outcomes) {
        for told in outcome.told.iter().filter(|told| told.verdict != Verdict::True) {
            rows.push(vec![
                outcome.name.clone(),
                told.check.clone(),
                told.instance.to_string(),
                if told.level == Level::Critical { "critical" } else { "warning" }.to_owned(),
                format!("{:.1}", told.at_s),
                told.verdict.name().to_owned(),
                told.evidence.clone(),
            ]);
        }
    }
    rows
}

#[cfg(test)]
mod tests {
    use tempfile::TempDir;

    use super::*;

    const HEAD: &str = "file,check,instance,onset,label,cause\n";

    fn folder(labels: &str) -> TempDir {
        let folder = tempfile::tempdir().unwrap();
        for name in ["ap_quad_faults.tlog", "px4_hil_quad_low.tlog"] {
            fs::copy(root().join("tests/flights").join(name), folder.path().join(name)).unwrap();
        }
        fs::write(folder.path().join("labels-mine.csv"), format!("{HEAD}{labels}")).unwrap();
        folder
    }

    fn refusal(labels: &str) -> String {
        format!("{:#}", find(folder(labels).path(), Known::Yes).unwrap_err())
    }

    /// The vibration of 86 s is the flight's first finding; low voltage follows, with its consequences.
    #[test]
    fn two_recordings_give_counts_rates_and_whether_the_cause_came_first() {
        let folder = folder(
            "ap_quad_faults.tlog,,,,flight,vibration\n\
             ap_quad_faults.tlog,vibration_rise,0,86.5,needless,\"small, and over soon\"\n\
             ap_quad_faults.tlog,cell_voltage,0,,true,10.2 V\n\
             px4_hil_quad_low.tlog,,,,flight,\n",
        );
        let set = find(folder.path(), Known::No).unwrap().unwrap();
        let results = [judge(&set).unwrap()];
        let outcomes = &results[0].outcomes;
        let armed_s = outcomes.iter().map(|one| one.armed_s).sum::<f64>();
        assert!((armed_s - 554.0).abs() < 2.0, "{armed_s}");
        let rows = rates(&results, &[]);
        assert_eq!(rows[0][1..9], ["once", "2", "0.15", "warning", "0", "1", "0", "0"], "{outcomes:?}");
        assert_eq!(rows[1][4..9], ["critical", "1", "0", "0", "0"]);
        assert_eq!(
            rows[0][9..13],
            an_hour(0, armed_s).into_iter().chain(an_hour(1, armed_s)).collect::<Vec<_>>()
        );
        assert_eq!(rows[0][13], "1 of 1 (100 %, at least 5 %)");
        let each = each(&results);
        assert_eq!(each[0][1..4], ["vibration_rise", "0", "warning"]);
        assert_eq!(each[0][5..], ["needless", "small, and over soon"]);
    }

    #[test]
    fn a_finding_without_a_label_has_its_own_column() {
        let folder =
            folder("ap_quad_faults.tlog,,,,flight,gnss\nap_quad_faults.tlog,cell_voltage,,300,false,late\n");
        let results = [judge(&find(folder.path(), Known::Yes).unwrap().unwrap()).unwrap()];
        let rows = rates(&results, &[]);
        assert_eq!(rows[0][2..9], ["1", "0.09", "warning", "0", "0", "0", "1"]);
        assert_eq!(rows[1][4..9], ["critical", "0", "0", "0", "1"], "the label begins later");
        assert_eq!(rows[0][13], "0 of 1 (0 %, at least 0 %)", "vibration is not of the receiver");
    }

    #[test]
    fn a_label_holds_for_one_rise() {
        let verdicts = |onsets: &[f64], rises: &[f64]| {
            let label = |(place, onset_s): (usize, &f64)| Label {
                onset_s: *onset_s,
                verdict: Verdict::True,
                evidence: place.to_string(),
            };
            let labels: Vec<Label> = onsets.iter().enumerate().map(label).collect();
            let mut left = labels.as_slice();
            let of = |at_s: &f64| take(&mut left, *at_s).map_or("-".to_owned(), |one| one.evidence.clone());
            rises.iter().map(of).collect::<String>()
        };
        for (onsets, rises, labelled) in [
            (&[50.0][..], &[50.0, 500.0][..], "0-"),
            (&[0.0], &[30.0, 60.0, 90.0], "0--"),
            (&[50.0], &[39.9, 40.0], "-0"),
            (&[50.0, 55.0], &[50.0, 55.0], "01"),
            (&[50.0, 55.0], &[45.0, 52.0, 58.0], "01-"),
            // The check rises at 50 s no more.
            (&[50.0, 500.0], &[500.0], "1"),
            (&[50.0, 400.0], &[400.0, 500.0], "1-"),
        ] {
            assert_eq!(verdicts(onsets, rises), labelled, "{onsets:?} {rises:?}");
        }
    }

    #[test]
    fn the_first_finding_is_the_first_since_the_fault() {
        let right = |flight: &str| {
            let folder = folder(&format!("ap_quad_faults.tlog,,,{flight}\n"));
            rates(&[judge(&find(folder.path(), Known::Yes).unwrap().unwrap()).unwrap()], &[])[0][13][..1]
                .to_owned()
        };
        assert_eq!((right(",flight,power"), right("225.6,flight,power")), ("0".into(), "1".into()));
    }

    #[test]
    fn tables_that_are_wrong_are_refused_with_their_row() {
        for (labels, said) in [
            ("nowhere.tlog,,,,flight,\n", "row 2, nowhere.tlog: no such recording"),
            ("ap_quad_faults.tlog,,,,flight,luck\n", "no class luck"),
            ("ap_quad_faults.tlog,roll,,,true,\n", "the flight has no row"),
            ("ap_quad_faults.tlog,,,,flight,\nap_quad_faults.tlog,,,,flight,\n", "row 3"),
            ("ap_quad_faults.tlog,,,,flight,\nap_quad_faults.tlog,luck,,,true,\n", "no check luck"),
            ("ap_quad_faults.tlog,,,,flight,\nap_quad_faults.tlog,roll,,,maybe,\n", "maybe is no label"),
            ("ap_quad_faults.tlog,,,,flight,\nap_quad_faults.tlog,roll,,soon,true,\n", "onset soon"),
            ("ap_quad_faults.tlog,,,nan,flight,gnss\n", "onset nan is no time"),
            ("ap_quad_faults.tlog,,,,flight,\nap_quad_faults.tlog,roll,,inf,true,\n", "onset inf"),
            ("ap_quad_faults.tlog,,,,flight,\nap_quad_faults.tlog,roll,-1,,true,\n", "instance -1"),
            ("ap_quad_faults.tlog,,,,flight,\nap_quad_faults.tlog,roll,1.7,,true,\n", "instance 1.7"),
            ("ap_quad_faults.tlog,,,,flight,\nap_quad_faults.tlog,roll,300,,true,\n", "instance 300"),
            ("ap_quad_faults.tlog,,,,flight,\nap_quad_faults.tlog,roll,nan,,true,\n", "instance nan"),
        ] {
            let error = refusal(labels);
            assert!(error.contains(said) && error.contains("labels-mine.csv"), "{error}");
        }
    }

    #[test]
    fn a_folder_without_a_table_is_of_another_kind() {
        assert!(find(&root().join("tests/flights"), Known::Yes).unwrap().is_none());
    }
}
