//! Shares an app's wgpu device with the finder, so that no second device is opened.
//!
//! `cargo run --release --example own_device`

use pbig_core::{Aabb, Backend, Config, Finder};
use pbig_gpu::GpuFinder;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // An app has these already.
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle_from_env());
    let adapter = pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions::default()))?;
    // By default a buffer has at most 128 MiB: 5.6 million boxes.
    let limits = wgpu::DeviceDescriptor { required_limits: adapter.limits(), ..Default::default() };
    let (device, queue) = pollster::block_on(adapter.request_device(&limits))?;

    let gpu = GpuFinder::from_device(device, queue)?;
    println!("on {}", gpu.adapter());
    let config = Config { backend: Backend::Device, ..Config::DEFAULT };
    let mut finder = Finder::with_device(config, Box::new(gpu));

    // A hardware GPU takes a million as well. A software adapter takes a moment for this many.
    let boxes: Vec<Aabb> = (0..20_000u32)
        .map(|i| Aabb::from_center([(i % 100) as f32, (i / 100 % 100) as f32, (i / 10_000) as f32], [0.5; 3]))
        .collect();
    let pairs = finder.find(&boxes)?.len();
    let report = finder.report();
    println!("{} boxes, {pairs} pairs; {}", report.boxes, report.plan);
    if let Some(why) = &report.fallback {
        println!("note: {why}");
    }
    let gpu = report.device.as_ref().ok_or("the CPU did the work")?;
    println!("  {} bytes up, {} down, {} held on the device", gpu.uploaded, gpu.downloaded, gpu.device_bytes);
    Ok(())
}
