//! A block device has the length 0 in its metadata.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use hums_tests::flights::own;
use hums_tests::not_tested;
use hums_tests::program::{Machine, Recording, hums, hums_with};
use serde_json::Value;

/// Gone when dropped.
struct Loop(PathBuf);

impl Loop {
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
fn a_raw_device_is_read_like_its_image_by_each_command_and_never_written() {
    let recording = Recording::make(Machine::Sim, &own("px4_hil_quad_low.tlog"), &["--card-size", "64"]);
    let image = recording.image();
    let Some(device) = Loop::over(&image) else {
        not_tested("a raw device (no loop device can be made here)");
        return;
    };
    assert_eq!(fs::metadata(&device.0).unwrap().len(), 0, "its metadata says nothing of its length");
    let told = |words: &[&str], path: &Path| -> Value {
        let all = words.iter().map(AsRef::as_ref).chain([path.as_os_str()]);
        let outcome = hums(all).expect_code(&[0, 4]);
        serde_json::from_str(&outcome.text().replace(&path.display().to_string(), "CARD")).unwrap()
    };
    for words in [&["info", "--json"][..], &["info", "--verify", "--json"], &["check", "--json"]] {
        assert_eq!(told(words, &device.0), told(words, &image), "{words:?}");
    }
    let out = tempfile::tempdir().unwrap();
    let decoded = |path: &Path, name: &str| {
        let to = out.path().join(name);
        hums_with("decode {} -o {} --format tlog", &[&path, &to]).expect_code(&[0]);
        fs::read(to).unwrap()
    };
    assert!(decoded(&device.0, "device.tlog") == decoded(&image, "image.tlog"));
    let page = out.path().join("page.html");
    hums_with("report {} -o {}", &[&device.0, &page]).expect_code(&[0]);

    let before = fs::read(&image).unwrap();
    let tlog = own("px4_hil_quad_low.tlog");
    let (tlog, device) = (tlog.display(), device.0.display());
    for line in [
        format!("decode --format hum {tlog} -o {device}"),
        format!("report {tlog} -o {device}"),
        format!("sim {tlog} --sd {device}"),
        format!("sim udpin:127.0.0.1:14559 --sd {device}"),
        format!("sim {tlog} --sd {}/card.img --gs {device}", out.path().display()),
        format!("sim {tlog} --sd {}/card.img --tap {device}", out.path().display()),
    ] {
        let refused = hums(line.split(' ')).expect_code(&[2]);
        assert!(refused.stderr.contains("is a disk or a card"), "{line}: {}", refused.stderr);
    }
    assert!(fs::read(&image).unwrap() == before);
}
