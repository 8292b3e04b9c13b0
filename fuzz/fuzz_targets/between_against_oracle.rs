#![no_main]

libfuzzer_sys::fuzz_target!(|data: &[u8]| pbig_harness::checks::between_against_oracle(data));
