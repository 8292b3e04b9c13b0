//! Contracts of the kernels' texts: every kernel is valid WGSL, its bindings are the listed ones, and no file is missing
//! in the lists. These tests need no device.

mod integers;
mod translate;

use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};
use pbig_shaders::{Buffer, INDEX_PAIRS, KERNELS, Kernel};

fn parse(kernel: &Kernel) -> naga::Module {
    let source = kernel.source();
    naga::front::wgsl::parse_str(&source)
        .unwrap_or_else(|error| panic!("{}: {}", kernel.name, error.emit_to_string(&source)))
}

fn validate(kernel: &Kernel) -> (naga::Module, ModuleInfo) {
    let module = parse(kernel);
    let result = Validator::new(ValidationFlags::all(), Capabilities::empty()).validate(&module);
    let info =
        result.unwrap_or_else(|error| panic!("{}: {}", kernel.name, error.emit_to_string(&kernel.source())));
    (module, info)
}

/// Returns every kernel, that of tests too.
fn kernels() -> impl Iterator<Item = &'static Kernel> {
    KERNELS.iter().copied().chain([&INDEX_PAIRS])
}

#[test]
fn every_kernel_is_valid() {
    kernels().for_each(|kernel| _ = validate(kernel));
}

#[test]
fn bindings_are_numbered_as_listed_and_there_are_no_others() {
    for kernel in kernels() {
        let (module, _) = validate(kernel);
        let mut bound: Vec<(u32, String)> = module
            .global_variables
            .iter()
            .filter_map(|(_, v)| v.binding.as_ref().map(|b| (b.binding, v.name.clone().unwrap_or_default())))
            .collect();
        bound.sort();
        let listed: Vec<_> =
            (0u32..).zip(kernel.bindings.iter().map(|buffer| buffer.name().to_owned())).collect();
        assert_eq!(bound, listed, "{}", kernel.name);
    }
}

/// Without validation of indirect dispatches the number of workgroups is 0 on DirectX 12.
#[test]
fn no_text_asks_for_the_number_of_workgroups() {
    for kernel in kernels() {
        assert!(!kernel.source().contains("num_workgroups"), "{}", kernel.name);
    }
}

/// Returns the names of the kernels' files, sorted.
fn files() -> Vec<String> {
    let mut files: Vec<String> = std::fs::read_dir(env!("CARGO_MANIFEST_DIR"))
        .expect("the crate's folder")
        .filter_map(|entry| entry.expect("an entry").file_name().into_string().ok())
        .filter_map(|name| name.strip_suffix(".wgsl").map(str::to_owned))
        .collect();
    files.sort();
    files
}

#[test]
fn the_list_of_kernels_is_the_list_of_files() {
    let mut listed: Vec<String> = KERNELS.iter().map(|kernel| kernel.name.to_owned()).collect();
    listed.sort();
    assert_eq!(listed, files());
}

#[test]
fn uniform_buffers_are_the_ones_that_say_so() {
    for kernel in kernels() {
        let (module, _) = validate(kernel);
        for (_, variable) in module.global_variables.iter().filter(|(_, v)| v.binding.is_some()) {
            let is_uniform = variable.space == naga::AddressSpace::Uniform;
            let name = variable.name.as_deref();
            let buffer = kernel.bindings.iter().find(|buffer| Some(buffer.name()) == name);
            assert_eq!(buffer.map(|buffer| Buffer::is_uniform(*buffer)), Some(is_uniform), "{}", kernel.name);
        }
    }
}

#[test]
fn kernels_stay_within_the_limits_that_every_device_has() {
    for kernel in kernels() {
        let (module, _) = validate(kernel);
        let entry = &module.entry_points[0];
        assert_eq!((module.entry_points.len(), entry.name.as_str()), (1, kernel.name));
        assert!(entry.workgroup_size.iter().product::<u32>() <= 256, "{}: invocations", kernel.name);
        let in_space = |space| module.global_variables.iter().filter(move |(_, v)| v.space == space);
        let size = |v: &naga::GlobalVariable| module.types[v.ty].inner.size(module.to_ctx());
        let shared: u32 = in_space(naga::AddressSpace::WorkGroup).map(|(_, v)| size(v)).sum();
        assert!(shared <= 16_384, "{}: {shared} bytes of workgroup memory", kernel.name);
        let is_storage = |v: &naga::GlobalVariable| matches!(v.space, naga::AddressSpace::Storage { .. });
        let storage = module.global_variables.iter().filter(|(_, v)| is_storage(v)).count();
        assert!(storage <= 8, "{}: {storage} storage buffers", kernel.name);
    }
}

#[test]
fn a_broken_kernel_does_not_pass() {
    let broken = pbig_shaders::LOCATE.source().replace("params.boxes", "params.bodies");
    assert!(naga::front::wgsl::parse_str(&broken).is_err());
}
