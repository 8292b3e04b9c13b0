//! `pbig doctor`: what this machine offers, what is chosen and why, and a self-test.

use crate::output::{Failure, print};
use pbig_core::gpu::{GpuError, adapters};
use pbig_core::{Backend, Coding, Config, Finder, GpuFinder, GpuOptions, Limits, Strategy, oracle};
use pbig_harness::boxes::BoxSet;

pub(crate) fn run() -> Result<(), Failure> {
    let Limits { max_boxes, max_pairs } = Limits::DEFAULT;
    print(&format!(
        "pbig {}\n\
         CPU: {} threads, SIMD found: {}; SIMD used: {}\n\
         limits: {max_boxes} boxes, {max_pairs} pairs (pbig_core::Limits)\n\
         backend auto: cpu; a GPU only where an app hands one over and it is measured to be faster\n\
         strategy: below {} boxes without a grid",
        env!("CARGO_PKG_VERSION"),
        rayon::current_num_threads(),
        simd_found().join(" "),
        pbig_core::simd(),
        Config::DEFAULT.brute_below,
    ))?;
    let gpus = describe_adapters()?;
    print("self-test, 2000 boxes of each set against brute force:")?;
    let mut wrong = test_cpu()?;
    for (name, gpu) in gpus {
        wrong.extend(test_gpu(&name, &gpu)?);
    }
    if wrong.is_empty() {
        Ok(())
    } else {
        Err(Failure::Check(format!("self-test failed: {}", wrong.join(", "))))
    }
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

/// An adapter, its limits, and the variant of each stage that runs on it and why.
fn describe(i: usize, adapter: &wgpu::Adapter, opened: &Result<GpuFinder, GpuError>) -> String {
    let (info, limits) = (adapter.get_info(), adapter.limits());
    let chosen = if i == 0 { ", used by `--backend gpu` unless WGPU_ADAPTER_NAME names another" } else { "" };
    let mib = |bytes: u64| bytes >> 20;
    let features = match opened {
        Ok(gpu) => gpu.variants().join("\n    "),
        Err(why) => format!("not usable: {why}"),
    };
    format!(
        "adapter gpu {i}: {}, driver {} {}{chosen}\n    \
         limits: buffers {} MiB, bindings {} MiB, {} storage buffers, {} invocations, {} KiB workgroup memory\n    {}",
        pbig_core::gpu::describe(&info),
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

/// Every strategy of the CPU; returns what was wrong.
fn test_cpu() -> Result<Vec<String>, Failure> {
    let mut wrong = Vec::new();
    for (name, backend, strategy) in [
        ("grid", Backend::Cpu, Strategy::Grid),
        ("pbig grid", Backend::Cpu, Strategy::Pbig),
        ("brute", Backend::Brute, Strategy::Auto),
    ] {
        let finder = Finder::new(Config { backend, strategy, ..Config::DEFAULT });
        wrong.extend(test(name, finder)?);
    }
    Ok(wrong)
}

/// Both codings on a device; returns what was wrong.
fn test_gpu(name: &str, gpu: &GpuFinder) -> Result<Vec<String>, Failure> {
    let mut wrong = Vec::new();
    for (coding, words) in [(Coding::Plain, "plain"), (Coding::Packed, "packed")] {
        let options = GpuOptions { coding, ..GpuOptions::DEFAULT };
        let config =
            Config { backend: Backend::Gpu, strategy: Strategy::Pbig, gpu: options, ..Config::DEFAULT };
        wrong.extend(test(&format!("{name} {words}"), Finder::with_gpu(config, gpu.clone()))?);
    }
    Ok(wrong)
}

/// A finder on every set. A device that leaves the work to the CPU has failed the test.
fn test(name: &str, mut finder: Finder) -> Result<Vec<String>, Failure> {
    let mut wrong = Vec::new();
    for set in BoxSet::ALL {
        let boxes = set.boxes(2000, 1);
        let right = finder.find(&boxes).is_ok_and(|found| found == oracle::pairs(&boxes));
        let verdict = match &finder.report().fallback {
            Some(why) => why,
            None if right => "ok",
            None => "WRONG",
        };
        print(&format!("  {name:<12} {:<10} {verdict}", set.name))?;
        if verdict != "ok" {
            wrong.push(format!("{name} on {}", set.name));
        }
    }
    Ok(wrong)
}

#[cfg(target_arch = "x86_64")]
pub(crate) fn simd_found() -> Vec<&'static str> {
    let found = [
        ("sse4.2", is_x86_feature_detected!("sse4.2")),
        ("avx2", is_x86_feature_detected!("avx2")),
        ("fma", is_x86_feature_detected!("fma")),
        ("avx512f", is_x86_feature_detected!("avx512f")),
    ];
    found.into_iter().filter(|(_, has)| *has).map(|(name, _)| name).collect()
}

#[cfg(not(target_arch = "x86_64"))]
pub(crate) fn simd_found() -> Vec<&'static str> {
    vec![std::env::consts::ARCH]
}
