//! Contract: kernels decide by integers. Compilers may contract, reorder and flush floats, and assume that there is no NaN: Metal's
//! does unless it is told not to. So one coordinate could get two cells.

use super::{kernels, validate};
use naga::valid::FunctionInfo;
use naga::{Function, Module, ScalarKind};

/// Returns true if a function has a value of floats, or of abstract numbers that become floats.
fn has_floats(module: &Module, function: &Function, info: &FunctionInfo) -> bool {
    function.expressions.iter().any(|(handle, _)| {
        let kind = info[handle].ty.inner_with(&module.types).scalar_kind();
        kind == Some(ScalarKind::Float)
    })
}

/// Returns the names of the functions of a text that compute with floats.
fn float_functions(module: &Module, info: &naga::valid::ModuleInfo) -> Vec<String> {
    let functions = module.functions.iter().map(|(handle, function)| (function, &info[handle]));
    let entries = module.entry_points.iter().enumerate();
    let all = functions.chain(entries.map(|(i, entry)| (&entry.function, info.get_entry_point(i))));
    let floats = all.filter(|(function, info)| has_floats(module, function, info));
    floats.map(|(function, _)| function.name.clone().unwrap_or_default()).collect()
}

/// `pair_at` corrects any estimate by integers: tests/suite/kernels/indices.rs. The extents that `measure` finds decide the cells, and so
/// the time alone.
#[test]
fn no_kernel_computes_with_floats_but_for_the_estimate_of_a_row_and_for_plans() {
    let mut estimates = 0;
    for kernel in kernels() {
        let (module, info) = validate(kernel);
        let mut floats = float_functions(&module, &info);
        estimates += floats.len();
        floats
            .retain(|name| name != "estimated_row" && (kernel.name, name.as_str()) != ("measure", "extent"));
        assert!(floats.is_empty(), "{}: {floats:?}", kernel.name);
    }
    assert!(estimates > 0, "this test sees no floats");
}
