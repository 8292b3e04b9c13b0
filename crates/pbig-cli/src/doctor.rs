//! `pbig doctor`: what this machine offers, what is chosen and why, and a self-test.

use pbig_core::{Aabb, Backend, Config, Finder, Limits, Pair, oracle};
use pbig_gpu::layout::DeviceBox;
use pbig_gpu::{Coding, GpuError, GpuFinder, GpuOptions, adapters};
use pbig_harness::prelude::*;
use pbig_harness::report::simd_found;

pub(crate) fn run() -> Result<(), Failure> {
    let Limits { max_boxes, max_pairs } = Limits::DEFAULT;
    print(&format!(
        "pbig {}\n\
         CPU: {} threads, SIMD found: {}; SIMD used: {}\n\
         limits: {max_boxes} boxes, {max_pairs} pairs (pbig_core::Limits)\n\
         backend auto: cpu; a GPU only where an app hands one over and searches many boxes",
        env!("CARGO_PKG_VERSION"),
        rayon::current_num_threads(),
        simd_found().join(" "),
        pbig_core::simd(),
    ))?;
    let gpus = describe_adapters()?;
    print("self-test, 2000 boxes of each set against brute force:")?;
    let finders = cpu_finders().into_iter().chain(gpus.iter().flat_map(gpu_finders));
    let mut wrong = Vec::new();
    for (name, finder) in finders {
        wrong.extend(test(&name, finder)?);
    }
    check(wrong.is_empty(), || format!("self-test failed: {}", wrong.join(", ")))
}

/// Prints every adapter, and returns those on which the kernels can run.
fn describe_adapters() -> Result<Vec<(String, GpuFinder)>, Failure> {
    let adapters = adapters();
    if adapters.is_empty() {
        let why = match GpuFinder::new() {
            Err(why @ GpuError::UnknownApi { .. }) => format!(": {why}"),
            _ => String::new(),
        };
        print(&format!("adapters: none; `--backend gpu` falls back to the CPU{why}"))?;
    }
    let mut usable = Vec::new();
    for (i, adapter) in adapters.iter().enumerate() {
        let opened = GpuFinder::on(adapter);
        print(&describe(i, adapter, &opened))?;
        usable.extend(opened.ok().map(|gpu| (format!("gpu {i}"), gpu)));
    }
    Ok(usable)
}

/// Returns the variant of each stage that runs on an adapter, and the reason.
fn variants(adapter: &wgpu::Adapter) -> [String; 3] {
    let (features, limits) = (adapter.features(), adapter.limits());
    let times = match features.contains(wgpu::Features::TIMESTAMP_QUERY) {
        true => "by timestamps",
        false => "none: the adapter has no timestamps",
    };
    let most = limits.max_buffer_size.min(limits.max_storage_buffer_binding_size) / 256 * 256;
    [
        "check, small cells: the device's square root, corrected by integers; large cells: balanced rows"
            .into(),
        format!("times of kernels: {times}"),
        format!("sets are searched in parts from {} boxes on", most / size_of::<DeviceBox>() as u64),
    ]
}

/// An adapter, its limits, and the variant of each stage that runs on it and why.
fn describe(i: usize, adapter: &wgpu::Adapter, opened: &Result<GpuFinder, GpuError>) -> String {
    let (info, limits) = (adapter.get_info(), adapter.limits());
    let chosen = if i == 0 { ", used by `--backend gpu` unless WGPU_ADAPTER_NAME names another" } else { "" };
    let mib = |bytes: u64| bytes >> 20;
    let features = match opened {
        Ok(_) => variants(adapter).join("\n    "),
        Err(why) => format!("not usable: {why}"),
    };
    format!(
        "adapter gpu {i}: {}, driver {} {}{chosen}\n    \
         limits: buffers {} MiB, bindings {} MiB, {} storage buffers, {} invocations, {} KiB workgroup memory\n    {}",
        pbig_gpu::describe(&info),
        info.driver,
        info.driver_info,
        mib(limits.max_buffer_size),
        mib(limits.max_storage_buffer_binding_size),
        limits.max_storage_buffers_per_shader_stage,
        limits.max_compute_invocations_per_workgroup,
        limits.max_compute_workgroup_storage_size >> 10,
        features,
    )
}

fn cpu_finders() -> [(String, Finder); 2] {
    [("cpu", Backend::Cpu), ("brute", Backend::Brute)]
        .map(|(name, backend)| (name.into(), Finder::new(Config { backend, ..Config::DEFAULT })))
}

/// Returns finders on a device in both codings, always with the grid.
fn gpu_finders((name, gpu): &(String, GpuFinder)) -> [(String, Finder); 2] {
    [(Coding::Plain, "plain"), (Coding::Packed, "packed")].map(|(coding, words)| {
        let options = GpuOptions { coding, all_pairs_up_to: 0, ..GpuOptions::DEFAULT };
        let config = Config { backend: Backend::Device, ..Config::DEFAULT };
        let gpu = gpu.clone().with_options(options);
        (format!("{name} {words}"), Finder::with_device(config, Box::new(gpu)))
    })
}

/// Returns the pairs of boxes. A device that leaves the work to the CPU is an error.
fn find(finder: &mut Finder, boxes: &[Aabb]) -> Result<Vec<Pair>, String> {
    let pairs = finder.find(boxes).map_err(|error| error.to_string())?.to_vec();
    finder.report().fallback.clone().map_or(Ok(pairs), Err)
}

/// Tests a finder on every set; returns what was wrong.
fn test(name: &str, mut finder: Finder) -> Result<Vec<String>, Failure> {
    let mut wrong = Vec::new();
    for set in BoxSet::ALL {
        let boxes = set.boxes(2000, 1);
        let verdict = match find(&mut finder, &boxes) {
            Err(why) => why,
            Ok(pairs) if pairs == oracle::pairs(&boxes) => "ok".into(),
            Ok(_) => "WRONG".into(),
        };
        print(&format!("  {name:<12} {:<10} {verdict}", set.name))?;
        if verdict != "ok" {
            wrong.push(format!("{name} on {}", set.name));
        }
    }
    Ok(wrong)
}
