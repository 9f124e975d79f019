//! Where the file of waiting points is, so that the next program finds it.
//!
//! One file a database: points never go to another one than they were made for. A second program that writes to the
//! same database meanwhile has a file of its own (`-2`, `-3`, ...); what a killed one has left in such a file is taken
//! over by the next that starts.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result};

use super::spool::Spool;
use super::target::{Database, Target};
use crate::files::{Inputs, make_directory};
use crate::outcome::usage;

/// Programs that write to one database from one PC at a time.
const FILES_MAX: usize = 8;

/// Opens the file that the user named, or the database's own.
pub fn open(named: Option<&Path>, target: &Target, limit: u64, inputs: &Inputs) -> Result<Spool> {
    if let Some(path) = named {
        inputs.refuse(path)?;
        return Spool::open(path, limit, &target.database())?
            .with_context(|| format!("--spool {}: another hums uses it; name another file", path.display()));
    }
    let folder =
        folder(|name| std::env::var_os(name).filter(|value| !value.is_empty())).ok_or_else(|| {
            usage("--influx: there is no folder for points that wait; name a file with --spool")
        })?;
    make_directory(&folder)?;
    let mut own: Option<Spool> = None;
    for number in 1..=FILES_MAX {
        let path = folder.join(name(target, number));
        match &mut own {
            None => own = Spool::open(&path, limit, &target.database())?,
            Some(own) if path.exists() => adopt(own, &path, limit, &target.database())?,
            Some(_) => {}
        }
    }
    own.with_context(|| {
        format!("--influx: {FILES_MAX} programs write to this database already; name a file with --spool")
    })
}

/// Takes over what a program has left that no longer runs.
fn adopt(own: &mut Spool, path: &Path, limit: u64, database: &Database) -> Result<()> {
    let Some(mut left) = Spool::open(path, limit, database)? else { return Ok(()) };
    let context = || format!("{}: cannot be read", path.display());
    own.lose(left.damage());
    while let Some(batch) = left.oldest().with_context(context)? {
        if !own.has_room(&batch) {
            // It waits for a start with more room.
            break;
        }
        own.put(&batch).with_context(context)?;
        left.drop_oldest().with_context(context)?;
    }
    Ok(())
}

/// The service's own folder where systemd has made one, or the user's (XDG Base Directory Specification 0.8), or on
/// Windows the user's for this PC.
fn folder(variable: impl Fn(&str) -> Option<OsString>) -> Option<PathBuf> {
    if let Some(folders) = variable("STATE_DIRECTORY") {
        return std::env::split_paths(&folders).next();
    }
    let state = variable("XDG_STATE_HOME").map(PathBuf::from).filter(|path| path.is_absolute());
    let home = || Some(PathBuf::from(variable("HOME")?).join(".local/state"));
    let local = || variable("LOCALAPPDATA").map(PathBuf::from);
    Some(state.or_else(home).or_else(local)?.join("hums"))
}

fn name(target: &Target, number: usize) -> String {
    let database = target.database().number;
    let suffix = if number == 1 { String::new() } else { format!("-{number}") };
    format!("influx-{database:016x}{suffix}.spool")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::live::influx::batch::Batch;

    #[test]
    fn the_folder_is_the_services_or_the_users() {
        let of = |variables: &[(&str, &str)]| {
            folder(|name| Some(variables.iter().find(|(known, _)| *known == name)?.1.into()))
        };
        let folders = std::env::join_paths(["/var/lib/hums", "/var/lib/other"]).expect("a list");
        let folders = folders.to_str().expect("text");
        assert_eq!(of(&[("STATE_DIRECTORY", folders), ("HOME", "/home/a")]), Some("/var/lib/hums".into()));
        let absolute = if cfg!(windows) { "C:/x" } else { "/x" };
        let own = of(&[("XDG_STATE_HOME", absolute), ("HOME", "/home/a")]);
        assert_eq!(own, Some(PathBuf::from(absolute).join("hums")));
        assert_eq!(
            of(&[("XDG_STATE_HOME", "x"), ("HOME", "/home/a")]),
            Some("/home/a/.local/state/hums".into())
        );
        assert_eq!(of(&[]), None);
    }

    #[test]
    fn what_a_killed_second_program_has_left_is_taken_over() {
        let dir = tempfile::tempdir().expect("a folder");
        let (first, second) = (dir.path().join("a"), dir.path().join("b"));
        let batch = |number: u64| Batch { text: format!("m v={number}\n").into_bytes(), points: 1 };
        let database = Target::new("http://h", None, None, "hums").expect("an address").database();
        let open = |path: &Path| Spool::open(path, 10_000, &database).expect("a file").expect("free");
        let mut own = open(&first);
        let mut left = open(&second);
        own.put(&batch(1)).expect("room");
        left.put(&batch(2)).expect("room");
        adopt(&mut own, &second, 10_000, &database).expect("it is left alone");
        assert_eq!(own.points(), 1, "it is in use");
        drop(left);
        adopt(&mut own, &second, 10_000, &database).expect("it is read");
        assert_eq!(own.points(), 2);
        let left = open(&second);
        assert!(left.is_empty());
    }

    #[test]
    fn each_database_has_its_own_file() {
        let of = |url: &str, bucket: &str| {
            name(&Target::new(url, Some("secret"), None, bucket).expect("an address"), 1)
        };
        assert_ne!(of("http://h:8086", "hums"), of("http://h:8086", "other"));
        assert_ne!(of("http://h:8086", "hums"), of("http://i:8086", "hums"));
        assert!(!of("http://h:8086", "hums").contains("secret"));
    }
}
