//! The corpus on WebGPU, in every mode of the pipeline, compared with brute force. `wasm/gpu/run.mjs` calls it under node and in a
//! browser, whose compilers of kernels no native test uses.

mod modes;

use crate::to_js;
use modes::MODES;
use pbig_core::Aabb;
use pbig_gpu::GpuFinder;
use pbig_harness::boxes::BoxSet;
use pbig_harness::corpus::{Case, corpus};
use std::future::poll_fn;
use std::pin::pin;
use std::task::Poll;
use wasm_bindgen::prelude::*;

/// Counts of a run.
#[wasm_bindgen(getter_with_clone)]
#[derive(Debug, Default)]
pub struct Outcome {
    /// Number of sets whose pairs were compared.
    pub sets: u32,
    /// Number of sets with a difference.
    pub failed: u32,
    /// Number of sets that the device declined: the CPU's, in a finder.
    pub declined: u32,
    /// Number of pairs in all sets.
    pub pairs: u32,
    /// The first difference; empty without one.
    pub first: String,
    /// Name of the adapter.
    pub adapter: String,
}

impl Outcome {
    fn count(&mut self, set: &str, result: Result<usize, String>) {
        self.sets += 1;
        match result {
            Ok(pairs) => self.pairs += pairs as u32,
            Err(why) if why.starts_with("Declined") => self.declined += 1,
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
pub async fn run(mode: usize, most_boxes: usize) -> Result<Outcome, JsError> {
    let mode = &MODES[mode];
    let gpu = GpuFinder::open_async().await.map_err(to_js)?;
    let mut outcome = Outcome { adapter: gpu.adapter().to_owned(), ..Outcome::default() };
    // Later sets meet the buffers and the plan of the earlier ones.
    let mut gpu = gpu.with_options(mode.options());
    for set in sets(most_boxes.min(mode.most_boxes)) {
        let result = modes::check(&mut gpu, mode, &set.boxes).await;
        outcome.count(&set.name, result);
    }
    Ok(outcome)
}

/// Gives up a call while the device works, and makes one beside it. Returns the first fault; empty without one.
///
/// # Errors
/// If there is no device.
#[wasm_bindgen]
pub async fn interrupt() -> Result<String, JsError> {
    let gpu = GpuFinder::open_async().await.map_err(to_js)?;
    Ok(interrupted(&mut gpu.clone(), &mut gpu.clone()).await.err().unwrap_or_default())
}

/// Uses two finders on one device.
async fn interrupted(gpu: &mut GpuFinder, beside: &mut GpuFinder) -> Result<(), String> {
    let (mode, boxes) = (&MODES[0], on_ground("uniform").boxes);
    modes::check(gpu, mode, &boxes).await?;
    {
        let mut call = pin!(modes::check(gpu, mode, &boxes));
        let is_waiting = poll_fn(|context| Poll::Ready(call.as_mut().poll(context).is_pending())).await;
        let refusal = modes::check(beside, mode, &boxes).await.err().unwrap_or_default();
        if !is_waiting || !refusal.contains("another call of the page uses the device") {
            return Err(format!("waiting: {is_waiting}, refusal: {refusal:?}"));
        }
    }
    modes::check(gpu, mode, &boxes).await?;
    modes::check(beside, mode, &boxes).await.map(|_| ())
}

/// Returns the sets of at most this number of boxes: the corpus, and larger ones.
fn sets(most_boxes: usize) -> Vec<Case> {
    let large = ["uniform", "mixed", "pile", "degenerate"].map(on_ground);
    corpus().into_iter().chain(large).filter(|case| case.boxes.len() <= most_boxes).collect()
}

/// Returns a set of thousands of boxes on a ground, and some with the floats that break comparisons.
fn on_ground(name: &str) -> Case {
    let mut boxes = BoxSet::named(name).expect("the set exists").boxes(6000, 11);
    let odd = [f32::NAN, -f32::NAN, -0.0, 1e-45, f32::NEG_INFINITY, f32::INFINITY, f32::MAX];
    for (i, odd) in odd.into_iter().enumerate() {
        boxes[50 * i].min[i % 3] = odd;
        boxes[50 * i + 1].max[i % 3] = odd;
        boxes[50 * i + 2] = Aabb::new([odd; 3], [odd; 3]);
    }
    boxes.push(Aabb::new([f32::NEG_INFINITY; 3], [f32::INFINITY, 1.0, f32::INFINITY]));
    Case { name: format!("{name} on a ground"), boxes }
}
