//! Any fuzz target: the one that `HUMS_FUZZ_TARGET` names.
#![no_main]

use std::sync::LazyLock;

use hums_fuzz::Target;

static TARGET: LazyLock<&'static Target> = LazyLock::new(|| {
    let name = std::env::var("HUMS_FUZZ_TARGET").expect("HUMS_FUZZ_TARGET names a target");
    hums_fuzz::target(&name).unwrap_or_else(|| panic!("HUMS_FUZZ_TARGET: there is no target {name}"))
});

libfuzzer_sys::fuzz_target!(|data: &[u8]| (TARGET.check)(data));
