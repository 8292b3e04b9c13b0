//! Workgroup memory holds anything when a workgroup starts. Every kernel runs with a text that first fills this memory with
//! a number that no kernel expects.

use super::*;
use naga::{AddressSpace, ArraySize, Module, Scalar, ScalarKind, TypeInner};
use std::collections::HashMap;
use std::sync::{LazyLock, Mutex};

/// The text of a kernel, and the load balancing that its pipeline was made for.
type Key = (String, bool);

/// Returns the pipeline of a kernel's text.
pub(super) fn pipeline_of(
    device: &wgpu::Device,
    kernel: &Kernel,
    text: &str,
    options: &GpuOptions,
) -> wgpu::ComputePipeline {
    static PIPELINES: LazyLock<Mutex<HashMap<Key, wgpu::ComputePipeline>>> = LazyLock::new(Mutex::default);
    let mut pipelines = PIPELINES.lock().expect("no test panics while it compiles");
    let make = || compile(device, kernel, text, options.load_balancing);
    pipelines.entry((text.to_owned(), options.load_balancing)).or_insert_with(make).clone()
}

fn compile(device: &wgpu::Device, kernel: &Kernel, text: &str, balanced: bool) -> wgpu::ComputePipeline {
    let source = wgpu::ShaderSource::Wgsl(text.into());
    let module =
        device.create_shader_module(wgpu::ShaderModuleDescriptor { label: Some(kernel.name), source });
    let balanced = ("BALANCED", f64::from(u8::from(balanced)));
    let constants: Vec<_> = [balanced].into_iter().filter(|_| text.contains("override BALANCED")).collect();
    device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some(kernel.name),
        layout: None,
        module: &module,
        entry_point: Some(kernel.name),
        compilation_options: wgpu::PipelineCompilationOptions {
            constants: &constants,
            zero_initialize_workgroup_memory: false,
        },
        cache: None,
    })
}

/// Returns the text of a kernel that fills all workgroup memory before its first statement.
pub(super) fn poisoned(kernel: &Kernel) -> String {
    let text = kernel.source();
    let module = naga::front::wgsl::parse_str(&text).expect("a valid text");
    let shared = module.global_variables.iter().filter(|(_, v)| v.space == AddressSpace::WorkGroup);
    let fills: Vec<String> = shared
        .map(|(_, v)| fill(&module, v.ty, v.name.as_deref().expect("variables of WGSL have names"), 0))
        .collect();
    if fills.is_empty() {
        return text;
    }
    let entry = text.find(&format!("fn {}(", kernel.name)).expect("the entry point");
    let start = entry + text[entry..].find("{\n").expect("the body of the entry point") + 1;
    format!("{}\n{}workgroupBarrier();{}", &text[..start], fills.concat(), &text[start..])
}

/// Returns a statement that fills a place of workgroup memory. The lanes share the elements of an array.
fn fill(module: &Module, ty: naga::Handle<naga::Type>, place: &str, depth: usize) -> String {
    match &module.types[ty].inner {
        TypeInner::Scalar(Scalar { kind: ScalarKind::Uint, .. }) => format!("{place} = 0xdeadbeefu;\n"),
        TypeInner::Scalar(_) => format!("{place} = -559038737;\n"),
        TypeInner::Vector { .. } => format!("{place} -= {place} + 559038737;\n"),
        TypeInner::Atomic(_) => format!("atomicStore(&{place}, 0xdeadbeefu);\n"),
        TypeInner::Array { base, size: ArraySize::Constant(size), .. } => {
            let (i, first, step) =
                (format!("i{depth}"), ["lane", "0u"][depth.min(1)], [256, 1][depth.min(1)]);
            let element = fill(module, *base, &format!("{place}[{i}]"), depth + 1);
            format!("for (var {i} = {first}; {i} < {size}u; {i} += {step}u) {{ {element} }}\n")
        }
        TypeInner::Struct { members, .. } => {
            let member = |m: &naga::StructMember| {
                let name = m.name.as_deref().expect("members of WGSL have names");
                fill(module, m.ty, &format!("{place}.{name}"), depth)
            };
            members.iter().map(member).collect()
        }
        other => panic!("{place} is {other:?}"),
    }
}

#[test]
fn all_workgroup_memory_is_poisoned() {
    let text = poisoned(&shaders::CHECK_LARGE);
    let filled = |what: &str| assert!(text.contains(what), "{what} in {text}");
    filled("for (var i0 = lane; i0 < 4u; i0 += 256u) { atomicStore(&tally[i0], 0xdeadbeefu);");
    filled("staged_boxes[i0].high[i1] = -559038737;");
    filled("placed = 0xdeadbeefu;");
    for kernel in all_kernels().filter(|kernel| kernel.source().contains("var<workgroup>")) {
        naga::front::wgsl::parse_str(&poisoned(kernel)).expect("a valid text");
        assert_ne!(poisoned(kernel), kernel.source(), "{}", kernel.name);
    }
}
