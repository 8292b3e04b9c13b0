//! The device: the adapter that the browser prefers, at the limits that WebGPU guarantees on every device.

use crate::to_js;
use pbig_core::{DeviceFailure, DeviceFound, SearchRequest};
use pbig_gpu::GpuFinder;
use wasm_bindgen::prelude::*;

/// An open device.
pub(crate) struct Device {
    pub(crate) finder: GpuFinder,
    pub(crate) limits: wgpu::Limits,
    pub(crate) has_timestamps: bool,
}

impl Device {
    pub(crate) async fn open() -> Result<Self, JsError> {
        let (device, queue) = request().await.map_err(to_js)?;
        let has_timestamps = device.features().contains(wgpu::Features::TIMESTAMP_QUERY);
        let finder = GpuFinder::from_device(device, queue).map_err(to_js)?;
        Ok(Self { finder, limits: wgpu::Limits::default(), has_timestamps })
    }
}

/// Returns a device of the adapter, with timestamps if it has them.
///
/// # Errors
/// The browser's reason.
pub(crate) async fn request() -> Result<(wgpu::Device, wgpu::Queue), String> {
    let instance = wgpu::Instance::default();
    let power_preference = wgpu::PowerPreference::HighPerformance;
    let options = wgpu::RequestAdapterOptions { power_preference, ..Default::default() };
    let adapter = instance.request_adapter(&options).await.map_err(|error| error.to_string())?;
    let required_features = adapter.features() & wgpu::Features::TIMESTAMP_QUERY;
    let required_limits = wgpu::Limits::default();
    let descriptor = wgpu::DeviceDescriptor { required_features, required_limits, ..Default::default() };
    adapter.request_device(&descriptor).await.map_err(|error| error.to_string())
}

/// Finds all pairs in ascending order. `found` keeps its memory.
pub(crate) async fn find(
    finder: &mut GpuFinder,
    request: &SearchRequest<'_>,
    found: &mut DeviceFound,
) -> Result<(), DeviceFailure> {
    finder.find_all_async(request, found).await?;
    if !found.pairs.is_sorted() {
        found.pairs.sort_unstable();
    }
    Ok(())
}

pub(crate) fn failure(failure: DeviceFailure) -> JsError {
    match failure {
        DeviceFailure::Failed(reason) | DeviceFailure::Declined(reason) => to_js(reason),
        DeviceFailure::TooManyPairs => to_js("there are too many pairs"),
    }
}
