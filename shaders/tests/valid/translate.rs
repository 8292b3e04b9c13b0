//! Contract: every kernel translates to SPIR-V, MSL and HLSL. These are the languages of Vulkan, Metal and
//! DirectX 12. As on a device, kernels clear their workgroup memory themselves. The SPIR-V passes `spirv-val`, if the machine has that program.

use super::{kernels, validate};
use naga::back::pipeline_constants::process_overrides;
use naga::back::{hlsl, msl, spv};
use naga::valid::ModuleInfo;
use pbig_shaders::{Buffer, Kernel};
use std::path::Path;
use std::process::{Command, Output};

/// Replaces the overridable constants of a module by their values.
fn with_constants((module, info): &(naga::Module, ModuleInfo)) -> (naga::Module, ModuleInfo) {
    let (module, info) =
        process_overrides(module, info, None, &Default::default()).expect("every override has a default");
    (module.into_owned(), info.into_owned())
}

/// Returns every kernel with its module.
fn modules() -> impl Iterator<Item = (&'static Kernel, (naga::Module, ModuleInfo))> {
    kernels().map(|kernel| (kernel, with_constants(&validate(kernel))))
}

fn spirv(module: &naga::Module, info: &ModuleInfo) -> Vec<u32> {
    let options = spv::Options {
        lang_version: (1, 0),
        zero_initialize_workgroup_memory: spv::ZeroInitializeWorkgroupMemoryMode::None,
        ..spv::Options::default()
    };
    spv::write_vec(module, info, &options, None).expect("SPIR-V")
}

/// Writes a translation into the folder that `PBIG_TEXTS` names, for `scripts/gpu.sh`. The file is named by the kernel and its
/// bindings: `u` for a uniform buffer, `s` for a storage buffer.
fn keep(kernel: &Kernel, ending: &str, text: &[u8]) {
    let Some(folder) = std::env::var_os("PBIG_TEXTS") else { return };
    let letter = |buffer: &Buffer| if buffer.is_uniform() { 'u' } else { 's' };
    let bindings: String = kernel.bindings.iter().map(letter).collect();
    let name = format!("{}.{bindings}.{ending}", kernel.name);
    std::fs::write(Path::new(&folder).join(name), text).expect("the folder exists");
}

fn bytes(words: &[u32]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_le_bytes()).collect()
}

/// Runs `spirv-val` on words of SPIR-V. Returns none if there is no such program.
fn judge(folder: &Path, words: &[u32]) -> Option<Output> {
    let file = folder.join("kernel.spv");
    std::fs::write(&file, bytes(words)).expect("a file in a new folder");
    Command::new("spirv-val").args(["--target-env", "vulkan1.1"]).arg(file).output().ok()
}

/// Returns false, and says so, if there is no `spirv-val`.
///
/// # Panics
/// With `CI=true`.
fn has_spirv_val() -> bool {
    let found = Command::new("spirv-val").arg("--version").output().is_ok();
    let is_ci = std::env::var("CI").is_ok_and(|ci| ci == "true");
    assert!(found || !is_ci, "spirv-val is missing (Debian: spirv-tools)");
    if !found {
        println!("left out: spirv-val is missing");
    }
    found
}

#[test]
fn every_kernel_is_valid_spirv() {
    let folder = tempfile::tempdir().expect("a folder");
    let judged = has_spirv_val();
    for (kernel, (module, info)) in modules() {
        let words = spirv(&module, &info);
        keep(kernel, "spv", &bytes(&words));
        let verdict = judge(folder.path(), &words).filter(|_| judged);
        let is_valid = verdict.as_ref().is_none_or(|output| output.status.success());
        assert!(is_valid, "{}: {verdict:?}", kernel.name);
    }
}

#[test]
fn broken_spirv_is_not_valid() {
    let folder = tempfile::tempdir().expect("a folder");
    let (_, (module, info)) = modules().next().expect("a kernel");
    let mut words = spirv(&module, &info);
    words.pop();
    if has_spirv_val() {
        let verdict = judge(folder.path(), &words).expect("it was there before");
        assert!(!verdict.status.success(), "{verdict:?}");
    }
}

#[test]
fn every_kernel_translates_to_metal() {
    for (kernel, (module, info)) in modules() {
        let options = msl::Options { lang_version: (2, 0), ..msl::Options::default() };
        let written = msl::write_string(&module, &info, &options, &msl::PipelineOptions::default());
        let (text, _) = written.unwrap_or_else(|error| panic!("{}: {error}", kernel.name));
        assert!(text.contains(&format!("kernel void {}", kernel.name)), "{text}");
    }
}

#[test]
fn every_kernel_translates_to_directx() {
    for (kernel, (module, info)) in modules() {
        let options = hlsl::Options {
            shader_model: hlsl::ShaderModel::V5_1,
            zero_initialize_workgroup_memory: false,
            ..hlsl::Options::default()
        };
        let (mut text, pipeline) = (String::new(), hlsl::PipelineOptions::default());
        let written = hlsl::Writer::new(&mut text, &options, &pipeline).write(&module, &info, None);
        written.unwrap_or_else(|error| panic!("{}: {error}", kernel.name));
        assert!(text.contains(&format!("void {}(", kernel.name)), "{text}");
        keep(kernel, "hlsl", text.as_bytes());
    }
}
