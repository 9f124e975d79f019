//! Makes the list of public keys from the folder `keys`. A release (`HUMS_RELEASE` is set) leaves out the test key.

use std::path::PathBuf;
use std::{env, fs};

fn main() {
    println!("cargo::rerun-if-changed=keys");
    println!("cargo::rerun-if-env-changed=HUMS_RELEASE");
    let is_release = env::var_os("HUMS_RELEASE").is_some();
    let mut files: Vec<PathBuf> = fs::read_dir("keys")
        .expect("the folder keys is in the source tree")
        .map(|entry| entry.expect("it can be listed").path())
        .filter(|path| path.extension().is_some_and(|ending| ending == "pub"))
        .collect();
    files.sort_unstable();
    let (mut all, mut test) = (Vec::new(), None);
    for path in files {
        let text = fs::read_to_string(&path).expect("it can be read");
        let key = bytes(&text).ok_or(path.display()).expect("wants 64 hexadecimal digits");
        let is_test = path.file_stem().is_some_and(|name| name == "test");
        if is_test {
            test = Some(format!("{key:?}"));
        }
        if !(is_test && is_release) {
            all.push(format!("    {key:?},\n"));
        }
    }
    let test = test.expect("keys/test.pub");
    let all = all.concat();
    let code = format!(
        "/// Of each key.\npub const ALL: &[[u8; 32]] = &[\n{all}];\nconst TEST_KEY: [u8; 32] = {test};\n"
    );
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    fs::write(out.join("keys.rs"), code).expect("OUT_DIR can be written");
}

fn bytes(text: &str) -> Option<[u8; 32]> {
    let digits = text.trim().as_bytes();
    let mut key = [0; 32];
    if digits.len() != 64 {
        return None;
    }
    for (byte, pair) in key.iter_mut().zip(digits.chunks(2)) {
        *byte = u8::from_str_radix(std::str::from_utf8(pair).ok()?, 16).ok()?;
    }
    Some(key)
}
