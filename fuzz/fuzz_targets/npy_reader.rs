#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| pbig_fuzz::npy_reader(data));
