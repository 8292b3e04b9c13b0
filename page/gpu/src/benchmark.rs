//! The measurement of a set of boxes on the GPU, beside the CPU. JavaScript measures the times of whole calls.

use crate::device::{Device, failure, find};
use crate::to_js;
use pbig_core::{Aabb, Backend, Config, DeviceFound, Finder, Limits, SearchRequest};
use pbig_gpu::{GpuFinder, GpuOptions};
use pbig_harness::boxes::{BoxSet, moved};
use std::time::Duration;
use wasm_bindgen::prelude::*;

/// Finders on both processors, and the boxes of a measurement: those of even rounds have moved in odd ones.
#[wasm_bindgen]
pub struct Benchmark {
    device: Device,
    /// A finder whose kernels are timed, which makes a call slower.
    timed: GpuFinder,
    cpu: Finder,
    boxes: [Vec<Aabb>; 2],
    found: DeviceFound,
}

/// The device's report of a call: milliseconds and bytes.
#[wasm_bindgen]
#[allow(missing_docs)]
pub struct Report {
    pub wait_ms: f64,
    pub upload_ms: f64,
    pub plan_ms: f64,
    pub record_ms: f64,
    pub decode_ms: f64,
    pub uploaded_bytes: f64,
    pub downloaded_bytes: f64,
    pub device_bytes: f64,
}

/// The time of a kernel.
#[wasm_bindgen(getter_with_clone)]
pub struct KernelTime {
    /// Name of the kernel.
    pub name: String,
    /// Milliseconds on the device.
    pub ms: f64,
}

#[wasm_bindgen]
impl Benchmark {
    /// Opens the GPU.
    ///
    /// # Errors
    /// If there is no adapter, or if it refuses a device.
    pub async fn open() -> Result<Self, JsError> {
        let device = Device::open().await?;
        let timed =
            device.finder.clone().with_options(GpuOptions { time_kernels: true, ..GpuOptions::DEFAULT });
        let cpu = Finder::new(Config { backend: Backend::Cpu, limits: Limits::UNLIMITED, ..Config::DEFAULT });
        Ok(Self { device, timed, cpu, boxes: Default::default(), found: DeviceFound::default() })
    }

    /// Returns the limits of the device.
    pub fn limits(&self) -> String {
        let limits = &self.device.limits;
        let named = [
            ("max_buffer_size", limits.max_buffer_size),
            ("max_storage_buffer_binding_size", limits.max_storage_buffer_binding_size),
            ("max_storage_buffers_per_shader_stage", limits.max_storage_buffers_per_shader_stage.into()),
            ("max_compute_workgroup_storage_size", limits.max_compute_workgroup_storage_size.into()),
            ("max_compute_invocations_per_workgroup", limits.max_compute_invocations_per_workgroup.into()),
            ("max_compute_workgroups_per_dimension", limits.max_compute_workgroups_per_dimension.into()),
        ];
        named.map(|(name, limit)| format!("{name} {limit}")).join(", ")
    }

    /// Returns true if the device tells the time of each kernel.
    pub fn has_timestamps(&self) -> bool {
        self.device.has_timestamps
    }

    /// Makes the boxes of a set.
    ///
    /// # Errors
    /// If no set has this name.
    pub fn set_boxes(&mut self, set: &str, count: u32) -> Result<(), JsError> {
        let set = BoxSet::named(set).ok_or_else(|| to_js("no set of boxes has this name"))?;
        let start = set.boxes(count as usize, 1);
        self.boxes = [moved(&start, 1.0, 2), start];
        Ok(())
    }

    /// Finds the pairs of a round on the CPU.
    ///
    /// # Errors
    /// The text of pbig's error.
    pub fn find_on_cpu(&mut self, round: u32) -> Result<(), JsError> {
        self.cpu.find(&self.boxes[round as usize % 2]).map_err(to_js)?;
        Ok(())
    }

    /// Finds the pairs of a round on the GPU, kernel by kernel if they are to be timed.
    ///
    /// # Errors
    /// The reason of the device.
    pub async fn find_on_gpu(&mut self, round: u32, times_kernels: bool) -> Result<(), JsError> {
        let finder = if times_kernels { &mut self.timed } else { &mut self.device.finder };
        let boxes = &self.boxes[round as usize % 2];
        let request = SearchRequest { boxes, filters: None, is_sorted: true, max_pairs: u64::MAX };
        find(finder, &request, &mut self.found).await.map_err(failure)
    }

    /// Returns true if both processors have found the same pairs.
    pub fn has_equal_pairs(&self) -> bool {
        self.cpu.pairs() == *self.found.pairs
    }

    /// Returns the number of pairs on the CPU.
    pub fn pair_count(&self) -> u32 {
        self.cpu.pairs().len() as u32
    }

    /// Returns the GPU's report of the last call.
    pub fn report(&self) -> Report {
        let report = &self.found.report;
        Report {
            wait_ms: ms(report.wait),
            upload_ms: ms(report.upload),
            plan_ms: ms(report.plan),
            record_ms: ms(report.record),
            decode_ms: ms(report.decode),
            uploaded_bytes: report.uploaded as f64,
            downloaded_bytes: report.downloaded as f64,
            device_bytes: report.device_bytes as f64,
        }
    }

    /// Returns the time of each kernel in the last call that timed them.
    pub fn kernels(&self) -> Vec<KernelTime> {
        let time = |(name, time): &(&str, Duration)| KernelTime { name: (*name).into(), ms: ms(*time) };
        self.found.report.kernels.iter().map(time).collect()
    }
}

fn ms(time: Duration) -> f64 {
    time.as_secs_f64() * 1e3
}
