//! A card in a reader is a block device, whose metadata says that it has no bytes.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use hums_tests::flights::own;
use hums_tests::program::{Machine, Recording, hums};
use serde_json::Value;

/// A loop device over an image; gone when dropped.
struct Loop(PathBuf);

impl Loop {
    /// None where this machine does not let us.
    fn over(image: &Path) -> Option<Self> {
        let made =
            Command::new("losetup").args(["--find", "--show", "--read-only"]).arg(image).output().ok()?;
        let path = String::from_utf8(made.stdout).ok()?;
        made.status.success().then(|| Self(PathBuf::from(path.trim())))
    }
}

impl Drop for Loop {
    fn drop(&mut self) {
        let _ = Command::new("losetup").arg("--detach").arg(&self.0).status();
    }
}

#[test]
fn a_raw_device_is_read_like_its_image() {
    let recording = Recording::make(Machine::Sim, &own("px4_hil_quad_low.tlog"), &["--card-size", "64"]);
    let image = recording.image();
    let Some(device) = Loop::over(&image) else {
        println!("NOT TESTED: a raw device (no loop device can be made here)");
        return;
    };
    assert_eq!(fs::metadata(&device.0).unwrap().len(), 0, "its metadata says nothing of its length");
    for command in ["info", "verify"] {
        let told = |path: &Path| -> Value {
            let outcome = hums([command.as_ref(), "--json".as_ref(), path.as_os_str()]).expect_code(&[0]);
            let shown = path.display().to_string();
            serde_json::from_str(&outcome.text().replace(&shown, "CARD")).unwrap()
        };
        assert_eq!(told(&device.0)["logs"], told(&image)["logs"], "{command}");
    }
    hums(["check".as_ref(), device.0.as_os_str()]).expect_code(&[0, 4]);
}
