//! Terminals and shells: colours, completions, the manual, the version.

use std::process::Command;

use super::support::{end_of, hums, recorded, run, text};

#[test]
fn colours_are_for_whoever_wants_them() {
    let dir = recorded();
    let shown = |variables: &[(&str, &str)], line: &str| {
        let mut command = hums();
        command.current_dir(dir.path()).args(line.split_whitespace());
        command.env_remove("NO_COLOR").envs(variables.iter().copied());
        text(&command.output().expect("it runs"))
    };
    let faults = end_of("ap_quad_faults.tlog", dir.path());
    for line in ["info --list card.img", "info --verify card.img", "info FAULTS", "check FAULTS card.img"] {
        let line = line.replace("FAULTS", &faults.display().to_string());
        let plain = shown(&[], &line);
        assert!(!plain.contains('\u{1b}') && !plain.contains('\u{fdd3}'), "{line}: {plain}");
        let forced = shown(&[("CLICOLOR_FORCE", "1")], &line);
        assert!(forced.contains("\u{1b}[") && !forced.contains('\u{fdd3}'), "{line}: {forced}");
        // No colour wins.
        assert_eq!(shown(&[("CLICOLOR_FORCE", "1"), ("NO_COLOR", "1")], &line), plain, "{line}");
        let json = shown(&[("CLICOLOR_FORCE", "1")], &line.replacen(' ', " --json ", 1));
        assert!(!json.contains('\u{1b}'), "{line}: {json}");
    }
}

#[test]
fn the_shell_and_the_manual_know_every_command() {
    let dir = tempfile::tempdir().expect("a folder");
    let page = text(&run(dir.path(), "man", 0));
    let bash = text(&run(dir.path(), "completions bash", 0));
    for command in ["decode", "check", "live", "info", "box"] {
        assert!(page.contains(&format!("hums\\-{command}(1)")), "{command}\n{page}");
        assert!(bash.contains(&format!("hums,{command})")), "{command}");
    }
    let decode = text(&run(dir.path(), "man decode", 0));
    assert!(decode.starts_with(".ie") || decode.contains(".TH hums-decode 1"), "{decode}");
    assert!(decode.contains("\\-\\-salvage") && decode.contains("hums decode"), "{decode}");
    assert!(text(&run(dir.path(), "man box pull", 0)).contains("\\-\\-around"));
    run(dir.path(), "man nothing", 2);
    run(dir.path(), "completions tcsh", 2);
    std::fs::write(dir.path().join("hums.bash"), &bash).expect("written");
    let typed =
        "source ./hums.bash; COMP_WORDS=(hums de); COMP_CWORD=1; _hums hums de hums; echo ${COMPREPLY[@]}";
    let completed = Command::new("bash").current_dir(dir.path()).args(["--norc", "-c", typed]).output();
    assert_eq!(text(&completed.expect("bash")).trim_end(), "decode");
}

#[test]
fn the_version_names_the_commit() {
    let dir = tempfile::tempdir().expect("a folder");
    let version = text(&run(dir.path(), "--version", 0));
    let commit = Command::new("git").args(["rev-parse", "--short=12", "HEAD"]).output().expect("git");
    let commit = String::from_utf8_lossy(&commit.stdout).trim().to_owned();
    assert_eq!(version.trim_end(), format!("hums {} (commit {commit})", env!("CARGO_PKG_VERSION")));
    let newest = include_str!("../../../CHANGELOG.md").lines().find_map(|line| line.strip_prefix("## "));
    assert!(newest.is_some_and(|title| title.starts_with(env!("CARGO_PKG_VERSION"))), "{newest:?}");
}
