//! The parts of the checks beside the modes. Each ends at its first fault, and counts what it has seen.

use super::{failing, limited, lost, random};
use pbig_core::Aabb;
use pbig_gpu::GpuFinder;
use pbig_harness::boxes::BoxSet;
use wasm_bindgen::prelude::*;

/// Counts with their names.
pub(super) type Counts = Vec<(&'static str, u32)>;

/// The result of a part.
#[wasm_bindgen(getter_with_clone)]
#[derive(Debug)]
pub struct Part {
    /// Counts of what was seen, none of which may be zero.
    pub counts: Vec<u32>,
    /// Names of the counts.
    pub names: Vec<String>,
    /// The first fault; empty without one.
    pub fault: String,
}

impl From<Result<Counts, String>> for Part {
    fn from(result: Result<Counts, String>) -> Self {
        let (counts, fault) = result.map_or_else(|why| (vec![], why), |counts| (counts, String::new()));
        let (names, counts) = counts.into_iter().map(|(name, count)| (name.to_owned(), count)).unzip();
        Self { counts, names, fault }
    }
}

/// Runs the part of this name.
#[wasm_bindgen]
pub async fn run_part(name: String) -> Part {
    let result = match name.as_str() {
        "random sets" => random::sets().await,
        "random changes" => random::changes().await,
        "faults" => failing::faults().await,
        "tiny limits" => limited::by_options().await,
        "a device of tiny limits" => limited::by_device_limits().await,
        "a device that is refused" => limited::refused().await,
        "lost devices" => lost::devices().await,
        _ => Err("there is no such part".to_owned()),
    };
    result.into()
}

/// Opens a device of pbig's own.
pub(super) async fn open() -> Result<GpuFinder, String> {
    GpuFinder::open_async().await.map_err(|error| error.to_string())
}

/// Returns a set as the suite's tests of devices use it.
pub(super) fn set(name: &str, n: usize) -> Vec<Aabb> {
    BoxSet::named(name).map_or(vec![], |set| set.boxes(n, 5))
}
