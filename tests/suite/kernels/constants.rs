//! Contract: constants and bindings are the same in Rust and in WGSL, and integers keep the order of floats. Kernels and twins
//! share each field of each struct.

use super::layout::{COMPLETE, NOT_PLANNED, PLAN_REFUSED, TOO_LARGE};
use super::*;

fn module_of(kernel: &Kernel) -> naga::Module {
    let parsed = naga::front::wgsl::parse_str(&kernel.source());
    parsed.unwrap_or_else(|error| panic!("{}: {error}", kernel.name))
}

/// Returns the value of a named constant of a kernel, if it has it.
fn constant_of(module: &naga::Module, name: &str) -> Option<u32> {
    let (_, constant) = module.constants.iter().find(|(_, c)| c.name.as_deref() == Some(name))?;
    match module.global_expressions[constant.init] {
        naga::Expression::Literal(naga::Literal::U32(value)) => Some(value),
        ref other => panic!("{name} is {other:?}"),
    }
}

const MAX_LEVELS: u32 = layout::MAX_LEVELS as u32;
const CELLS_PER_LANE: u32 = CELLS_PER_BLOCK / LANES;

/// Lists constants with their names.
macro_rules! named {
    ($($name:ident),*) => { [$((stringify!($name), $name)),*] };
}

#[test]
fn constants_are_those_of_the_kernels() {
    let everywhere = named! {
        LANES, GROUPS_PER_ROW, MAX_LEVELS, NO_LEVEL, SPAN_BITS, BOX_BITS, AXIS_BITS,
        FILTERED, COUNTED, UNPLANNED, COMPLETE, NOT_PLANNED, TOO_LARGE, PLAN_REFUSED
    };
    let somewhere = named! {
        CELLS_PER_BLOCK, CELLS_PER_LANE, COUNTS_PER_BLOCK, SHORT_ROW, WINDOW, PIECE, PIECES,
        FIRST_PIECE, CLASS_WORDS, SUMMARY_WORDS
    };
    let most_span = format!("const MAX_SPAN = {MAX_SPAN};");
    for kernel in all_kernels() {
        let module = module_of(kernel);
        for (name, value) in everywhere {
            assert_eq!(constant_of(&module, name), Some(value), "{}: {name}", kernel.name);
        }
        for (name, value) in somewhere {
            assert_eq!(constant_of(&module, name).unwrap_or(value), value, "{}: {name}", kernel.name);
        }
        // A parsed module does not keep constants without a type.
        assert!(kernel.source().contains(&most_span), "{}", kernel.name);
    }
}

#[test]
fn bindings_are_those_of_the_kernels() {
    for kernel in all_kernels() {
        let module = module_of(kernel);
        let variables = module.global_variables.iter().map(|(_, variable)| variable);
        let bound = variables.filter_map(|v| Some((v.binding.as_ref()?.binding, v.name.as_deref()?)));
        let wanted: Vec<_> = (0u32..).zip(kernel.bindings.iter().map(|buffer| buffer.name())).collect();
        assert_eq!(sorted(&bound.collect::<Vec<_>>()), wanted, "{}", kernel.name);
    }
}

#[test]
fn ordered_integers_keep_the_order_of_all_floats() {
    let above = [0.0, 1e-45, f32::MIN_POSITIVE, 1.0, f32::MAX, f32::INFINITY];
    let rising: Vec<f32> = above[1..].iter().rev().map(|x| -x).chain(above).collect();
    assert!(rising.windows(2).all(|two| ordered(two[0]) < ordered(two[1])));
    assert_eq!(ordered(-0.0), ordered(0.0));
}

#[test]
fn an_invalid_box_overlaps_nothing_not_even_everything() {
    let all = DeviceBox::new(&Aabb::new([f32::NEG_INFINITY; 3], [f32::INFINITY; 3]));
    for invalid in [Aabb::NOWHERE, Aabb::new([f32::INFINITY; 3], [f32::NEG_INFINITY; 3])] {
        let invalid = DeviceBox::new(&invalid);
        assert_eq!(invalid, DeviceBox::INVALID);
        assert!(!(0..3).any(|k| invalid.low[k] <= all.high[k] || all.low[k] <= invalid.high[k]));
    }
}
