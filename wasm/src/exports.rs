//! Functions that `run.mjs` calls, with integers only: no binding generator is needed.
//!
//! A call leaves a text behind: the report, or the message of a panic.

use std::sync::{Mutex, MutexGuard, PoisonError};

static TEXT: Mutex<String> = Mutex::new(String::new());

fn text() -> MutexGuard<'static, String> {
    TEXT.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Keeps the messages of panics, which end the module, as the text.
#[unsafe(no_mangle)]
pub extern "C" fn keep_panics() {
    std::panic::set_hook(Box::new(|panic| *text() = panic.to_string()));
}

/// Runs all checks, of which the first that fails is a panic.
#[unsafe(no_mangle)]
pub extern "C" fn run() {
    *text() = crate::run();
}

/// Returns the address of the text, in UTF-8.
#[unsafe(no_mangle)]
pub extern "C" fn text_address() -> *const u8 {
    text().as_ptr()
}

/// Returns the length of the text in bytes.
#[unsafe(no_mangle)]
pub extern "C" fn text_length() -> usize {
    text().len()
}
