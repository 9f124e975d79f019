//! The emulator's program, and its command line.

use std::fmt::Write as _;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail};

/// The emulator's program.
pub(super) const PROGRAM: &str = "qemu-system-arm";
/// Starts a program that is to be killed when its parent ends.
const SETPRIV: &str = "/usr/bin/setpriv";
/// The first version that models this chip's memory.
const VERSION_MIN: u32 = 8;

const ADVICE: &str = "\n  Debian 12:        add bookworm-backports, then apt-get install -t bookworm-backports qemu-system-arm\
                      \n  Debian 13, Ubuntu 24.04:  apt-get install qemu-system-arm\
                      \n  in the source tree:       cargo xtask setup\
                      \n  without an emulator:      hums sim runs the same pipeline on this PC";

/// Says what to do where QEMU is missing or too old.
pub fn check() -> Result<()> {
    let output = match Command::new(PROGRAM).arg("--version").stdin(Stdio::null()).output() {
        Ok(output) => output,
        Err(error) => bail!(
            "{PROGRAM} cannot be started ({error}); version {VERSION_MIN}.0 or later is needed:{ADVICE}"
        ),
    };
    let text = String::from_utf8_lossy(&output.stdout);
    let version = text.split("version ").nth(1).unwrap_or_default();
    let major: Option<u32> = version.split('.').next().and_then(|major| major.trim().parse().ok());
    match major {
        Some(major) if major < VERSION_MIN => {
            let found = version.split_whitespace().next().unwrap_or_default();
            bail!(
                "{PROGRAM} is {found}; it models this chip's memory only from version {VERSION_MIN}.0 on:{ADVICE}"
            )
        }
        Some(_) => Ok(()),
        None => bail!(
            "{PROGRAM} --version says nothing that is understood; version {VERSION_MIN}.0 is needed:{ADVICE}"
        ),
    }
}

/// What the command line tells besides the emulator's directory.
pub(super) struct Arguments<'a> {
    /// The image.
    pub(super) firmware: &'a Path,
    /// Further arguments of the firmware, `key=value`.
    pub(super) more: &'a [String],
    /// It counts the instructions of each stage.
    pub(super) costs: bool,
}

pub(super) fn command(start: &Arguments<'_>, dir: &Path) -> Command {
    let socket =
        |id: &str, more: &str| format!("socket,id={id},path={},server=on,{more}", escaped(&dir.join(id)));
    let mut arguments = "enable=on,target=native,arg=\"resets=1\"".to_owned();
    for (key, file) in [("sd", "card"), ("store", "store"), ("feed", "feed")] {
        let _ = write!(arguments, " \"{key}={}\"", escaped(&dir.join(file)));
    }
    for argument in start.more.iter().chain(start.costs.then(|| "cost=1".to_owned()).iter()) {
        let _ = write!(arguments, " \"{argument}\"");
    }
    let mut command = program();
    command
        .args(["-M", "netduinoplus2", "-nodefaults", "-display", "none", "-monitor", "none", "-kernel"])
        .arg(start.firmware)
        // The mux puts a buffer before the UART, which quadruples its pace; -echr takes its escape byte away.
        .args(["-chardev", &socket("ap", "wait=off,mux=on"), "-serial", "chardev:ap", "-echr", "256"])
        .args(["-chardev", &socket("gs", "wait=on"), "-serial", "chardev:gs"])
        .args(["-semihosting-config", &arguments])
        .current_dir(dir)
        // With this its clock counts instructions, as the firmware takes it for granted when it counts costs.
        .args(if start.costs { &["-icount", "shift=3"][..] } else { &[] })
        // Ctrl-C is for this program, which then lets the firmware close its log.
        .process_group(0);
    command
}

/// The emulator, which ends with this program however that ends: a killed one cannot end it. (`prctl` itself would need
/// unsafe code; util-linux has the program, and where it is not there, a killed run leaves its emulator waiting.)
fn program() -> Command {
    if !Path::new(SETPRIV).exists() {
        return Command::new(PROGRAM);
    }
    let mut command = Command::new(SETPRIV);
    // The signal is asked for after the start: had this program ended before, it would never come.
    let if_still_ours = r#"[ "$PPID" = "$0" ] && exec "$@""#;
    command.args([
        "--pdeathsig",
        "KILL",
        "--",
        "sh",
        "-c",
        if_still_ours,
        &std::process::id().to_string(),
        PROGRAM,
    ]);
    command
}

/// A path inside one of QEMU's options, where a comma ends the value.
fn escaped(path: &Path) -> String {
    path.display().to_string().replace(',', ",,")
}

/// Makes a pipe with a name.
pub(super) fn make_fifo(path: &Path) -> Result<()> {
    // POSIX has the program; the system call would need unsafe code or one more library.
    let status = Command::new("mkfifo").arg(path).status().context("mkfifo cannot be started")?;
    if status.success() { Ok(()) } else { bail!("mkfifo {}: failed", path.display()) }
}
