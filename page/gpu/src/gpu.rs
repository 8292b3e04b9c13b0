//! The GPU as the simulation uses it.

use crate::to_js;
use bytemuck::cast_slice;
use pbig_core::{DeviceFailure, DeviceFound, SearchRequest};
use pbig_gpu::GpuFinder;
use wasm_bindgen::prelude::*;

/// An open GPU.
#[wasm_bindgen]
pub struct Gpu {
    finder: GpuFinder,
    found: DeviceFound,
}

#[wasm_bindgen]
impl Gpu {
    /// Opens the GPU.
    ///
    /// # Errors
    /// If there is no adapter, or if it refuses a device.
    pub async fn open() -> Result<Self, JsError> {
        let finder = GpuFinder::open_async().await.map_err(to_js)?;
        Ok(Self { finder, found: DeviceFound::default() })
    }

    /// Returns the pairs of boxes that their filters allow, as two ids a pair. A box is six numbers, `min` and `max`. A filter is four
    /// numbers, the memory of a [`pbig_core::ProxyFilter`]; without filters all boxes may pair. Returns nothing if the device declines.
    ///
    /// # Errors
    /// The reason of the device.
    pub async fn find(
        &mut self,
        boxes: Vec<f32>,
        filters: Option<Vec<u32>>,
    ) -> Result<Option<Vec<u32>>, JsError> {
        let filters = filters.as_deref().map(cast_slice);
        let request =
            SearchRequest { boxes: cast_slice(&boxes), filters, is_sorted: true, max_pairs: u64::MAX };
        match self.finder.find_all_async(&request, &mut self.found).await {
            Ok(()) => Ok(Some(self.sorted_pairs())),
            Err(DeviceFailure::Declined(_)) => Ok(None),
            Err(DeviceFailure::Failed(reason)) => Err(to_js(reason)),
            Err(DeviceFailure::TooManyPairs) => Err(to_js("there are too many pairs")),
        }
    }

    fn sorted_pairs(&mut self) -> Vec<u32> {
        if !self.found.pairs.is_sorted() {
            self.found.pairs.sort_unstable();
        }
        cast_slice(&self.found.pairs).to_vec()
    }
}
