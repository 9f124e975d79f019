//! The documents that the tables make: `docs/parameters.md`, the checks in `docs/health.md` and `docs/check.md`, and the
//! counters in `docs/usage.md` follow the code. `HUMS_WRITE_DOCS=1 cargo test -p hums-core-tests docs` writes them.
#![expect(clippy::panic, clippy::unwrap_used, reason = "that is how a test fails")]

use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;

use hums_core::exposure;
use hums_core::health::{Check, CheckPhase, Side, checks};
use hums_core::parameters::{Param, Params, TABLE};
use hums_core::time::Millis;
use hums_link::vocabulary::{RadioWords, VOCABULARY, Words};

/// The inputs of each check, and the source of its limits unless a parameter is.
const INPUTS: &str = include_str!("inputs.txt");

fn path(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../docs").join(name)
}

#[track_caller]
fn assert_is(name: &str, wanted: &str) {
    if std::env::var_os("HUMS_WRITE_DOCS").is_some() {
        fs::write(path(name), wanted).unwrap();
    }
    let found = fs::read_to_string(path(name)).unwrap_or_default();
    assert!(found == wanted, "docs/{name} is not what the code says: write it anew (see this test's file)");
}

fn number(value: f32) -> String {
    if value.is_nan() { "off".to_owned() } else { format!("{value}") }
}

#[test]
fn the_parameters_are_documented_as_they_are() {
    let mut text = "# Parameters\n\n\
        For everyone who changes a setting of the box. Afterwards you know its unit, default, range and the source of the default. Example:\n\
        `hums box params set BAT_REM_WARN 20 --link serial:/dev/ttyUSB0:57600`. [companion.md](companion.md#parameters) has the other ways, [health.md](health.md#change-a-check) how to\n\
        switch a check off. The box stores the values, and refuses one outside its range. `firmware/core/tests/docs.rs` makes this table from the code.\n\n\
        | name | unit | default | range | what it is | more, and where the default comes from |\n|---|---|---|---|---|---|\n"
        .to_owned();
    for param in Param::ALL {
        let (spec, words) = (param.spec(), param.words());
        let (unit, default, what) = (words.unit, number(spec.default), hums_core_tests::short(param));
        let options = words.options.iter().enumerate().map(|(number, option)| format!("{number} {option}"));
        let options = options.collect::<Vec<_>>().join(", ");
        let options = if options.is_empty() { options } else { format!(": {options}") };
        let _ = writeln!(
            text,
            "| {} | {unit} | {default} | {} to {} | {what}{options} | {} |",
            spec.name, spec.min, spec.max, words.source
        );
    }
    assert_is("parameters.md", &text);
}

#[test]
fn mission_planner_gets_the_words_of_every_parameter() {
    let mut text = "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n\
        <!-- Made by firmware/core/tests/docs.rs. Where it goes: docs/companion.md. -->\n<Params>\n  <ArduCopter2>\n"
        .to_owned();
    for param in Param::ALL {
        let (spec, words) = (param.spec(), param.words());
        let _ = writeln!(text, "    <{}>", spec.name);
        let mut say = |element: &str, value: &dyn std::fmt::Display| {
            let value = value.to_string().replace('&', "&amp;").replace('<', "&lt;");
            if !value.is_empty() {
                let _ = writeln!(text, "      <{element}>{value}</{element}>");
            }
        };
        say("DisplayName", &hums_core_tests::short(param));
        let meaning =
            hums_core_tests::meaning(param).map_or_else(String::new, |meaning| format!("{meaning} "));
        let (more, default) = (hums_core_tests::long(param), number(spec.default));
        say("Description", &format!("{meaning}{more} Default: {default}."));
        say("Units", &words.unit);
        say("Range", &format!("{} {}", spec.min, spec.max));
        let options = words.options.iter().enumerate().map(|(number, option)| format!("{number}:{option}"));
        say("Values", &options.collect::<Vec<_>>().join(","));
        say("RebootRequired", &"False");
        let _ = writeln!(text, "    </{}>", spec.name);
    }
    text += "  </ArduCopter2>\n</Params>\n";
    assert_is("stations/ParameterMetaData.xml", &text);
}

fn inputs() -> impl Iterator<Item = (&'static str, &'static str)> {
    INPUTS.lines().filter_map(|line| line.split_once(": "))
}

fn assert_holds(document: &str, name: &str, table: &str) {
    let begin = format!("<!-- {name}: made by firmware/core/tests/docs.rs -->\n");
    let end = format!("<!-- end of {name} -->\n");
    let found = fs::read_to_string(path(document)).unwrap();
    let (before, rest) = found.split_once(&begin).expect("a place for the table");
    let (_, after) = rest.split_once(&end).expect("and it ends");
    assert_is(document, &format!("{before}{begin}{table}{end}{after}"));
}

fn limit(param: Option<Param>) -> String {
    param.map_or_else(
        || "–".to_owned(),
        |param| {
            let spec = &TABLE[param as usize];
            format!("{} ({})", number(Params::defaults().get(param)), spec.name)
        },
    )
}

fn seconds(span: Millis) -> String {
    format!("{} s", span.as_secs_f32())
}

fn row(check: &Check) -> String {
    let input = inputs().find(|(name, _)| *name == check.name);
    let (_, input) = input.unwrap_or_else(|| panic!("{}: say in inputs.txt what it reads", check.name));
    let side = if check.limits.side == Side::Above { ">" } else { "<" };
    let when = match check.when {
        CheckPhase::Always => "always",
        CheckPhase::Armed => "armed",
        CheckPhase::InFlight => "in flight",
    };
    let [warning_debounce, critical_debounce] = check.debounce_ms.map(|ms| Millis::from_millis(ms.into()));
    let source = check.limits.critical.or(check.limits.warn).map_or("", |param| param.words().source);
    format!(
        "| {} | {} | {input} | {when} | {side} | {} | {} | {} | {}, {} | {} | {} | {source} |",
        check.subsystem.name(),
        check.name,
        check.unit.name(),
        limit(check.limits.warn),
        limit(check.limits.critical),
        seconds(warning_debounce),
        seconds(critical_debounce),
        check.limits.hysteresis,
        check.stale_after().map_or_else(|| "–".to_owned(), seconds),
    )
}

#[test]
fn every_check_is_documented_as_it_is() {
    let mut table = "| subsystem | check | reads | when | bad | unit | warning | critical | debounce | hysteresis | stale after | source |\n\
        |---|---|---|---|---|---|---|---|---|---|---|---|\n"
        .to_owned();
    for check in checks() {
        let _ = writeln!(table, "{}", row(check));
    }
    assert_holds("health.md", "checks", &table);
    for (name, _) in inputs() {
        assert!(checks().any(|check| check.name == name), "there is no check {name}");
    }
}

fn finding(alarm: &str) -> String {
    alarm.split('|').next().unwrap().replace('#', "*n*")
}

#[test]
fn every_check_is_explained_as_people_are_told() {
    let mut table = "| check | finding | means | do | needs |\n|---|---|---|---|---|\n".to_owned();
    for Words { said, meaning, action, needs, .. } in VOCABULARY {
        let _ =
            writeln!(table, "| {} | {} | {meaning} | {action} | {needs} |", said.check, finding(said.alarm));
    }
    assert_holds("check.md", "words", &table);
}

#[test]
fn every_text_of_a_check_is_in_the_runbook() {
    let mut table = "| HUMS: | if critical | what is so | what to do |\n|---|---|---|---|\n".to_owned();
    let mut told = Vec::new();
    for (words, check) in VOCABULARY.iter().zip(checks()) {
        let RadioWords { alarm, advice, .. } = words.said;
        if told.contains(&alarm) {
            continue;
        }
        told.push(alarm);
        let unit = match check.unit.name() {
            "" => String::new(),
            "degC" => " C".to_owned(),
            "1/min" => " per min".to_owned(),
            "times" => " x".to_owned(),
            unit => format!(" {unit}"),
        };
        let value = words.said.around_value(check.unit.name());
        let value =
            value.map_or_else(String::new, |(before, after)| format!(": {before}*value*{unit}{after}"));
        let alarm = finding(alarm);
        let _ = writeln!(table, "| {alarm}{value} | {advice} | {} | {} |", words.meaning, words.action);
    }
    assert_holds("runbook.md", "texts", &table);
}

#[test]
fn every_counter_is_documented() {
    let mut table = "| counter | over sessions | definition |\n|---|---|---|\n".to_owned();
    let mut words = Vec::new();
    for line in include_str!("../src/usage/counters.rs").split_once("counters! {").unwrap().1.lines() {
        if let Some(text) = line.trim().strip_prefix("/// ") {
            words.push(text);
        } else if let Some((form, name)) = line.split_once(" \"") {
            let over = match form {
                form if form.ends_with("Highest") => "greatest",
                form if form.ends_with("Lowest") => "least",
                _ => "sum",
            };
            let _ = writeln!(
                table,
                "| `{}` | {over} | {} |",
                name.trim_end_matches("\";"),
                words.join(" ").trim_end_matches('.')
            );
            words.clear();
        } else if line == "}" {
            break;
        }
    }
    assert_holds("usage.md", "counters", &table);
    let text = fs::read_to_string(path("usage.md")).unwrap();
    for quantity in exposure::ExposureQuantity::ALL {
        assert!(text.contains(&format!("`{}_", quantity.name())), "docs/usage.md does not know {quantity:?}");
    }
}
