//! The clock of the page, for pbig's reports.

/// Gives the clock to pbig.
#[cfg(target_family = "wasm")]
pub(crate) fn give_clock() {
    use std::time::Duration;
    use wasm_bindgen::prelude::wasm_bindgen;

    #[wasm_bindgen]
    extern "C" {
        #[wasm_bindgen(js_namespace = performance)]
        fn now() -> f64;
    }
    pbig_core::internal::set_clock(|| Duration::from_secs_f64(now() / 1e3));
}

#[cfg(not(target_family = "wasm"))]
pub(crate) fn give_clock() {}
