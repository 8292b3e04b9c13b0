//! Runs the corpus on WebGPU, in every mode of the pipeline, and compares the pairs with the oracle's. `run.mjs` calls it under
//! node and in a browser.

mod changes;
mod modes;
mod sets;

use modes::{MODES, Mode};
use pbig_core::Aabb;
use pbig_gpu::GpuFinder;
use wasm_bindgen::prelude::wasm_bindgen;

#[wasm_bindgen]
extern "C" {
    #[wasm_bindgen(js_namespace = console)]
    fn error(text: &str);
}

/// Prints the messages of panics, which end the module.
#[wasm_bindgen]
pub fn keep_panics() {
    std::panic::set_hook(Box::new(|panic| error(&panic.to_string())));
}

/// Counts of a run.
#[wasm_bindgen]
#[derive(Clone, Debug, Default)]
pub struct Outcome {
    /// Number of calls whose pairs were compared.
    pub calls: u32,
    /// Number of calls with a difference.
    pub failed: u32,
    /// Number of pairs in all calls.
    pub pairs: u32,
    first: String,
    adapter: String,
}

#[wasm_bindgen]
impl Outcome {
    /// Returns the first failure; empty without one.
    #[wasm_bindgen(getter)]
    pub fn first(&self) -> String {
        self.first.clone()
    }

    /// Returns the adapter's name.
    #[wasm_bindgen(getter)]
    pub fn adapter(&self) -> String {
        self.adapter.clone()
    }

    fn count(&mut self, set: &str, result: Result<usize, String>) {
        self.calls += 1;
        match result {
            Ok(pairs) => self.pairs += pairs as u32,
            Err(why) => {
                self.failed += 1;
                if self.first.is_empty() {
                    self.first = format!("{set}: {why}");
                }
            }
        }
    }
}

/// Returns the names of the modes.
#[wasm_bindgen]
pub fn modes() -> Vec<String> {
    MODES.iter().map(|mode| mode.name.to_owned()).collect()
}

/// Runs the sets of at most this number of boxes in a mode.
///
/// # Errors
/// If there is no device.
#[wasm_bindgen]
pub async fn run(mode: usize, most_boxes: usize) -> Result<Outcome, String> {
    let mode = &MODES[mode];
    let gpu = GpuFinder::open_async().await.map_err(|error| error.to_string())?;
    let mut outcome = Outcome { adapter: gpu.adapter().to_owned(), ..Outcome::default() };
    // Later sets meet the buffers and the plan of the earlier ones.
    let mut gpu = gpu.with_options(mode.options());
    for set in sets::sets(most_boxes.min(mode.most_boxes)) {
        let result = run_set(&mut gpu, mode, &set.boxes).await;
        outcome.count(&set.name, result);
    }
    Ok(outcome)
}

async fn run_set(gpu: &mut GpuFinder, mode: &Mode, boxes: &[Aabb]) -> Result<usize, String> {
    if mode.finds_changes { changes::check(gpu, boxes).await } else { modes::check(gpu, mode, boxes).await }
}
