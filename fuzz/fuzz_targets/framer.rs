#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| hums_fuzz::framer::check(data));
