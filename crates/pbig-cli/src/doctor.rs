//! `pbig doctor`: what this machine offers, what is chosen and why, and a self-test.

use pbig_core::{Aabb, Backend, Config, Finder, Limits, Pair, oracle};
use pbig_gpu::{GpuError, GpuFinder, GpuOptions, adapters};
use pbig_harness::prelude::*;
use pbig_harness::report::simd_found;

#[derive(clap::Args)]
pub(crate) struct Args {
    /// The adapter that `--backend gpu` uses, by its number here or a part of its name, as in `pbig pairs --adapter NAME`.
    #[arg(long, value_name = "NAME")]
    adapter: Option<String>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// An adapter of this machine.
struct Candidate {
    adapter: wgpu::Adapter,
    opened: Result<GpuFinder, GpuError>,
    /// True for the adapter of `--backend gpu`.
    is_used: bool,
}

/// A finder, the set of boxes that it was tested on, and `ok` or what was wrong.
struct Tested {
    finder: String,
    set: &'static str,
    verdict: String,
}

/// The adapter of `--backend gpu`, or why there is none.
type Chosen = Result<wgpu::AdapterInfo, GpuError>;

pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let chosen = pbig_gpu::adapter(args.adapter.as_deref()).map(|adapter| adapter.get_info());
    if let (Some(name), Err(error)) = (&args.adapter, &chosen) {
        return Err(Failure::Input(format!("--adapter {name}: {error}")));
    }
    let candidates = candidates(&chosen);
    let say = |text: &str| if args.json { Ok(()) } else { print(text) };
    say(&describe_machine())?;
    say(&describe_adapters(&candidates, &chosen))?;
    say("self-test, 2000 boxes of each set against brute force:")?;
    let tested =
        test_all(&candidates, |one| say(&format!("  {:<12} {:<10} {}", one.finder, one.set, one.verdict)))?;
    if args.json {
        print(&object(&candidates, &chosen, &tested).to_string())?;
    }
    let wrong = tested.iter().filter(|one| one.verdict != "ok");
    let wrong: Vec<String> = wrong.map(|one| format!("{} on {}", one.finder, one.set)).collect();
    check(wrong.is_empty(), || format!("self-test failed: {}", wrong.join(", ")))
}

fn describe_machine() -> String {
    let Limits { max_boxes, max_pairs } = Limits::DEFAULT;
    format!(
        "pbig {}\n\
         CPU: {} threads, SIMD found: {}; SIMD used: {}\n\
         limits: {max_boxes} boxes, {max_pairs} pairs (pbig_core::Limits)\n\
         backend auto: cpu; a GPU only where an app hands one over and searches many boxes",
        env!("CARGO_PKG_VERSION"),
        rayon::current_num_threads(),
        simd_found().join(" "),
        pbig_core::simd(),
    )
}

/// Opens all adapters.
fn candidates(chosen: &Chosen) -> Vec<Candidate> {
    let mut candidates: Vec<Candidate> = Vec::new();
    for adapter in adapters() {
        let is_used = chosen.as_ref() == Ok(&adapter.get_info()) && !candidates.iter().any(|one| one.is_used);
        candidates.push(Candidate { opened: GpuFinder::on(&adapter), adapter, is_used });
    }
    candidates
}

/// Describes every adapter, and says why none is used, and what to do.
fn describe_adapters(candidates: &[Candidate], chosen: &Chosen) -> String {
    let fallback = |why| format!("`--backend gpu` falls back to the CPU: {why}");
    let mut lines: Vec<String> = candidates.iter().enumerate().map(describe).collect();
    match chosen {
        Err(why) if candidates.is_empty() => lines.push(format!("adapters: none; {}", fallback(why))),
        Err(why) => lines.push(fallback(why)),
        Ok(_) => {}
    }
    lines.extend(advice(candidates));
    lines.join("\n")
}

/// Returns what to do where no adapter is hardware.
fn advice(candidates: &[Candidate]) -> Option<String> {
    let is_software = |one: &Candidate| one.adapter.get_info().device_type == wgpu::DeviceType::Cpu;
    if !candidates.iter().all(is_software) {
        return None;
    }
    let causes = [wrong_api(), missing_driver()].into_iter().flatten();
    Some(format!("no GPU is found: {}{INSTALL}", causes.map(|cause| cause + ", or ").collect::<String>()))
}

/// The API of this system's GPUs.
const API: (wgpu::Backends, &str) = if cfg!(windows) {
    (wgpu::Backends::DX12, "dx12")
} else if cfg!(target_vendor = "apple") {
    (wgpu::Backends::METAL, "metal")
} else {
    (wgpu::Backends::VULKAN, "vulkan")
};

const INSTALL: &str = "install its driver with Vulkan (NVIDIA: the vendor's; AMD and Intel: mesa-vulkan-drivers on Debian and Ubuntu) and \
                       Vulkan's loader (libvulkan1). A container must be given the GPU; NVIDIA's also needs \
                       NVIDIA_DRIVER_CAPABILITIES=graphics,compute,utility";

fn wrong_api() -> Option<String> {
    let api = std::env::var("WGPU_BACKEND").ok()?;
    let (own, name) = API;
    let has_own = wgpu::Backends::from_comma_list(&api).contains(own);
    (!has_own).then(|| format!("WGPU_BACKEND={api:?} leaves out {name}: unset it"))
}

/// Returns what is wrong with the variable that names Vulkan's drivers. The first one counts.
fn missing_driver() -> Option<String> {
    let variables = ["VK_DRIVER_FILES", "VK_ICD_FILENAMES"].map(|name| (name, std::env::var_os(name)));
    let (variable, files) = variables.into_iter().find_map(|(name, files)| Some((name, files?)))?;
    let missing = std::env::split_paths(&files).find(|file| !file.exists())?;
    Some(format!("{variable} names {}, which does not exist: unset it", missing.display()))
}

/// Returns all that the text says, as JSON.
fn object(candidates: &[Candidate], chosen: &Chosen, tested: &[Tested]) -> serde_json::Value {
    let adapter = |one: &Candidate| {
        let (info, limits) = (one.adapter.get_info(), one.adapter.limits());
        serde_json::json!({
            "adapter": pbig_gpu::describe(&info),
            "driver": format!("{} {}", info.driver, info.driver_info),
            "is_software": info.device_type == wgpu::DeviceType::Cpu,
            "is_used": one.is_used,
            "error": one.opened.as_ref().err().map(ToString::to_string),
            "max_buffer_bytes": limits.max_buffer_size,
            "max_binding_bytes": limits.max_storage_buffer_binding_size,
            "max_boxes": max_boxes(&limits),
        })
    };
    let test =
        |one: &Tested| serde_json::json!({ "finder": one.finder, "boxes": one.set, "verdict": one.verdict });
    serde_json::json!({
        "version": env!("CARGO_PKG_VERSION"),
        "threads": rayon::current_num_threads(),
        "simd_found": simd_found(),
        "simd": pbig_core::simd().to_string(),
        "max_boxes": Limits::DEFAULT.max_boxes,
        "max_pairs": Limits::DEFAULT.max_pairs,
        "adapter": chosen.as_ref().ok().map(pbig_gpu::describe),
        "fallback": chosen.as_ref().err().map(ToString::to_string),
        "advice": advice(candidates),
        "adapters": candidates.iter().map(adapter).collect::<Vec<_>>(),
        "self_test": tested.iter().map(test).collect::<Vec<_>>(),
    })
}

/// Returns the number of boxes that fit a buffer of an adapter.
fn max_boxes(limits: &wgpu::Limits) -> u64 {
    limits.max_storage_buffer_binding_size / size_of::<Aabb>() as u64
}

/// Describes an adapter and its limits, and says why it cannot be used.
fn describe((i, Candidate { adapter, opened, is_used }): (usize, &Candidate)) -> String {
    let (info, limits) = (adapter.get_info(), adapter.limits());
    let chosen = if *is_used { ", used by `--backend gpu`" } else { "" };
    let mib = |bytes: u64| bytes >> 20;
    let error = opened.as_ref().err().map_or(String::new(), |why| format!("\n    not usable: {why}"));
    format!(
        "adapter gpu {i}: {}, driver {} {}{chosen}\n    \
         limits: buffers {} MiB, bindings {} MiB (at most {} boxes), {} storage buffers, {} invocations, {} KiB workgroup memory{error}",
        pbig_gpu::describe(&info),
        info.driver,
        info.driver_info,
        mib(limits.max_buffer_size),
        mib(limits.max_storage_buffer_binding_size),
        max_boxes(&limits),
        limits.max_storage_buffers_per_shader_stage,
        limits.max_compute_invocations_per_workgroup,
        limits.max_compute_workgroup_storage_size >> 10,
    )
}

fn cpu_finders() -> [(String, Finder); 2] {
    [("cpu", Backend::Cpu), ("brute", Backend::Brute)]
        .map(|(name, backend)| (name.into(), Finder::new(Config { backend, ..Config::DEFAULT })))
}

/// Returns a finder on a device that always makes a grid.
fn gpu_finder(gpu: &GpuFinder) -> Finder {
    let options = GpuOptions { all_pairs_up_to: 0, ..GpuOptions::DEFAULT };
    let config = Config { backend: Backend::Device, ..Config::DEFAULT };
    Finder::with_device(config, Box::new(gpu.clone().with_options(options)))
}

/// Returns the pairs of boxes. A device that leaves the work to the CPU is an error.
fn find(finder: &mut Finder, boxes: &[Aabb]) -> Result<Vec<Pair>, String> {
    let pairs = finder.find(boxes).map_err(|error| error.to_string())?.to_vec();
    finder.report().fallback.clone().map_or(Ok(pairs), Err)
}

/// Tests all finders on every set. Passes each result on as it comes.
fn test_all(
    candidates: &[Candidate],
    mut tell: impl FnMut(&Tested) -> Result<(), Failure>,
) -> Result<Vec<Tested>, Failure> {
    let opened = candidates.iter().enumerate().filter_map(|(i, one)| Some((i, one.opened.as_ref().ok()?)));
    let gpus = opened.map(|(i, gpu)| (format!("gpu {i}"), gpu_finder(gpu)));
    let mut tested = Vec::new();
    for (finder, mut it) in cpu_finders().into_iter().chain(gpus) {
        for set in BoxSet::ALL {
            let one = Tested { finder: finder.clone(), set: set.name, verdict: verdict(&mut it, set) };
            tell(&one)?;
            tested.push(one);
        }
    }
    Ok(tested)
}

fn verdict(finder: &mut Finder, set: BoxSet) -> String {
    let boxes = set.boxes(2000, 1);
    match find(finder, &boxes) {
        Err(why) => why,
        Ok(pairs) if pairs == oracle::pairs(&boxes) => "ok".into(),
        Ok(_) => "WRONG".into(),
    }
}
