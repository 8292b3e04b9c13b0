//! pbig on the GPU of a browser: all pairs of given boxes; for tests, the corpus. JavaScript calls everything here.

mod clock;
#[cfg(feature = "corpus")]
pub mod corpus;
mod gpu;

use std::sync::{Mutex, PoisonError};
use wasm_bindgen::prelude::*;

static PANIC: Mutex<String> = Mutex::new(String::new());

/// Gives pbig the page's clock, and keeps the message of a panic for [`panic_message`].
#[wasm_bindgen(start)]
pub fn start() {
    clock::give_clock();
    std::panic::set_hook(Box::new(|panic| {
        *PANIC.lock().unwrap_or_else(PoisonError::into_inner) = panic.to_string();
    }));
}

/// Returns the message of the panic that ended the module; empty without one.
#[wasm_bindgen]
pub fn panic_message() -> String {
    PANIC.lock().unwrap_or_else(PoisonError::into_inner).clone()
}

/// Returns an error for JavaScript, with the text of another one.
fn to_js(error: impl ToString) -> JsError {
    JsError::new(&error.to_string())
}
