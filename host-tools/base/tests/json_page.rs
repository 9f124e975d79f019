//! `docs/json.md`: a table for the object of each command, made from the structs behind it and their doc comments.
//! `HUMS_WRITE_DOCS=1 cargo test -p hums-base --test json_page` writes it.
#![expect(clippy::panic, reason = "that is how a test fails")]

use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

const HEAD: &str = "\
# Output for programs: `--json`

For people who write scripts around `hums`. After this page you know the names in the JSON of each command. The tables are made from
the code's structs by `host-tools/base/tests/json_page.rs`.

* With `--json` a command prints one object on standard output, `hums check` one object a line for each log. `schema` and `version` name it:
  each section below has its schema as the title. `version` rises when a name goes or changes its meaning. New names may come at any time.
* Names carry units: `_s` seconds, `_us` microseconds, `_utc` ISO 8601. Other times count from the box's power-on, in other recordings
  from their own zero. `null` means \"not known\" or \"none\". A name with `[]` is an element of a list.
* Messages, progress and errors go to standard error, as text. [cli.md](cli.md) has the exit codes. `hums completions` and `hums man` have no `--json`.

Example: the logs of a folder with a critical finding, and the parts of each vehicle that are due:
```
hums check --json logs/ | jq -r 'select(.verdict == \"critical\") | .log'
hums due --json logs/ | jq -r '.vehicles[] | .vehicle as $v | .parts[] | select(.status == \"red\") | \"\\($v) \\(.part)\"'
```
";

/// Of each object: the heading, the root (a struct's name, or its fields), the files with the structs, an introduction.
const OBJECTS: &str = "\
`hums-check` 1; LogJson; analysis/src/check/json.rs; One object a line for each log. \
    A log that cannot be read has `schema`, `version`, `log` and `error` only.
`hums-info-list` 1; images: Vec<ImageJson>, /// The oldest first. logs: Vec<LogJson>,; src/info/list.rs; Of `hums info --list`.
`hums-info` 1; images: Vec<ImageJson>, logs: Vec<LogJson>,; analysis/src/log_json.rs analysis/src/summary.rs; Of `hums info`.
`hums-info-verify` 1; images: Vec<ImageJson>, logs: Vec<LogJson>, /// Of all logs and images. ok: bool,; src/verify.rs; Of `hums info --verify`.
`hums-manifest` 1; Manifest; analysis/src/manifest.rs analysis/src/log_json.rs; The file of `--manifest FILE` of `hums info --verify` and `hums decode`.
`hums-due` 1; DueJson; src/info/due.rs; Of `hums due`.
`hums-decode` 1; MadeJson; export/src/made.rs; Of `hums decode`.
`hums-report` 1; PagesJson; report/src/report/mod.rs; Of `hums report`.
`hums-run` 1; RunReport; src/run/report.rs; Of `hums sim`.
`hums-pull` 1; PulledJson; src/talk/pull/mod.rs src/talk/pull/judge.rs; Of `hums box pull`.
`hums-params` 1; /// MAVLink system id of the box's vehicle. system: u8,;; Of `hums box params list`, `get` and `set`. \
    Each parameter is a name with its value, and unusual characters in a name are `\\u{a}`.
`hums-params-sign` 1; KeyJson; src/talk/params.rs; Of `hums box params sign`.
`hums-replaced` 1; ReplacedJson; src/talk/replaced.rs; Of `hums box replaced`.
`hums-card-reader` 1; CardReaderJson; src/talk/card_reader.rs; Of `hums box card-reader`.
`hums-box-update` 1; UpdateJson; src/talk/update.rs; Of `hums box update`.
`hums-format` 1; FormattedJson; src/talk/format.rs; Of `hums box format-card`.
`hums-setup` 1; SetupJson; src/talk/setup/mod.rs src/talk/setup/settings.rs; Of `hums box setup`.
`hums-box-report` 1; ReportJson; src/talk/report.rs; The file of `hums box report`.
`hums-live` 1; PagesJson; src/live/mod.rs; Of `hums live`, at its start.
";

/// Structs in several objects, in the same form.
const SHARED: &str = "\
`image`; ImageJson; analysis/src/log_json.rs; A card, or an image of one.
`end`; EndJson; formats/src/ending/json.rs; [decode.md](decode.md#whether-a-log-is-whole) explains the proof of a log's end.
`blocks`; BlocksJson; formats/src/ending/json.rs; Numbers of blocks of 512 bytes, by kind.
`finding`; FindingJson; analysis/src/log_json.rs; A change of level. [health.md](health.md) lists the checks.
`exceedance`; CrossingsJson; analysis/src/log_json.rs;
";

struct Field {
    name: String,
    kind: String,
    words: String,
    may_be_absent: bool,
}

/// The fields that serde writes.
fn fields(body: &str) -> Vec<Field> {
    let (mut fields, mut words, mut attributes) = (Vec::new(), Vec::new(), String::new());
    for line in body.lines().map(str::trim) {
        if let Some(text) = line.strip_prefix("///") {
            words.push(text.trim());
        } else if line.starts_with("#[") {
            attributes += line;
        } else if let Some((name, kind)) = line.split_once(": ") {
            let name = name.rsplit(' ').next().unwrap_or_default().trim_start_matches("r#");
            let is_of_schema = body.contains("schema: ") && ["schema", "version"].contains(&name);
            if !is_of_schema && !attributes.contains("serde(skip)") {
                fields.push(Field {
                    name: name.to_owned(),
                    kind: kind.trim_end_matches(',').to_owned(),
                    words: words
                        .join(" ")
                        .trim_end_matches('.')
                        .replace("[`", "`")
                        .replace("`]", "`")
                        .replace("`docs/", "`"),
                    may_be_absent: attributes.contains("skip_serializing_if"),
                });
            }
            words.clear();
            attributes.clear();
        }
    }
    fields
}

fn body<'a>(sources: &'a str, name: &str) -> Option<&'a str> {
    let start = ["", "<'a>"].iter().find_map(|with| sources.find(&format!("struct {name}{with} {{\n")))?;
    sources[start..].split_once('\n')?.1.split_once("\n}").map(|(body, _)| body)
}

/// The innermost type: `Vec<Option<&'a str>>` has `str`.
fn innermost(kind: &str) -> &str {
    let inner = kind.rsplit('<').find(|part| !part.starts_with("'a>")).unwrap_or(kind);
    let inner = inner.trim_end_matches(['>', ']']).trim_start_matches(['&', '[']);
    inner.trim_start_matches("'a ").trim_start_matches("'static ")
}

/// The heading of a struct in several objects.
fn shared(inner: &str) -> Option<&'static str> {
    let root = if inner == "Finding" { "; FindingJson;".to_owned() } else { format!("; {inner};") };
    let (heading, _) = SHARED.lines().find(|line| line.contains(&root))?.split_once(';')?;
    Some(heading.trim_matches('`'))
}

fn kind_in_words(Field { kind, may_be_absent, .. }: &Field, is_struct: bool) -> String {
    let inner = innermost(kind);
    let one = match inner {
        _ if let Some(name) = shared(inner) => format!("[{name}](#{name})"),
        _ if is_struct || kind.contains("Map<") || inner.contains("Value") => "object".to_owned(),
        "bool" => "true or false".to_owned(),
        "f32" | "f64" => "number".to_owned(),
        "u8" | "u16" | "u32" | "u64" | "usize" => "whole number".to_owned(),
        _ => "text".to_owned(),
    };
    let list = if kind.contains("Vec<") || kind.contains('[') { "list: " } else { "" };
    let or = match (may_be_absent, kind.starts_with("Option<")) {
        (true, _) => ", or left out",
        (false, true) => ", or null",
        (false, false) => "",
    };
    format!("{list}{one}{or}")
}

fn rows(sources: &str, body: &str, around: &str, table: &mut String) {
    for field in fields(body) {
        let inner = innermost(&field.kind);
        let is_shared = shared(inner).is_some();
        let inner = self::body(sources, inner).filter(|_| !is_shared);
        let element =
            format!("{around}{}{}", field.name, if field.kind.contains("Vec<") { "[]" } else { "" });
        let name = if is_shared { element.as_str() } else { element.trim_end_matches("[]") };
        let _ =
            writeln!(table, "| `{name}` | {} | {} |", kind_in_words(&field, inner.is_some()), field.words);
        if let Some(inner) = inner {
            rows(sources, inner, &format!("{element}."), table);
        }
    }
}

fn section(heading: &str, about: &str, files: &str, root: &str) -> String {
    let root_folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let read = |file: &str| {
        fs::read_to_string(root_folder.join(file)).unwrap_or_else(|error| panic!("{file}: {error}"))
    };
    let sources: String = files.split_whitespace().map(read).collect();
    let mut text = format!("\n## {heading}\n");
    if !about.is_empty() {
        let _ = write!(text, "\n{about}\n");
    }
    text += "\n| name | type | content |\n|---|---|---|\n";
    let fields = if root.contains(':') {
        root
    } else {
        body(&sources, root).unwrap_or_else(|| panic!("{files} has no struct {root}"))
    };
    rows(&sources, fields, "", &mut text);
    text
}

#[test]
fn the_page_of_json_has_every_name() {
    let mut text = HEAD.to_owned();
    for object in OBJECTS.lines().chain(SHARED.lines()) {
        let parts: Vec<&str> = object.split(';').map(str::trim).collect();
        let [heading, root, files, about] = parts[..] else { panic!("{object}") };
        text += &section(heading, about, files, &root.replace(", ", ",\n").replace(". ", ".\n"));
    }
    let path: PathBuf = [env!("CARGO_MANIFEST_DIR"), "../../docs/json.md"].iter().collect();
    if std::env::var_os("HUMS_WRITE_DOCS").is_some() {
        fs::write(&path, &text).expect("the page");
    }
    assert!(
        fs::read_to_string(&path).expect("the page") == text,
        "docs/json.md is old: see this test's file"
    );
}
