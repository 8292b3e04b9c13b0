//! Contract: structs, constants and bindings are the same in Rust and in WGSL, and integers keep the order of floats.

use super::*;

/// A Rust struct that kernels share.
struct SharedStruct {
    name: &'static str,
    size: usize,
    fields: Vec<(&'static str, usize)>,
}

macro_rules! shared_structs {
    ($($name:ident { $($field:ident),* })*) => {
        vec![$(SharedStruct {
            name: stringify!($name),
            size: size_of::<layout::$name>(),
            fields: vec![$((stringify!($field), offset_of!(layout::$name, $field))),*],
        }),*]
    };
}

fn shared_structs() -> Vec<SharedStruct> {
    shared_structs! {
        DeviceBox { low, high }
        Motion { now, before }
        BoxChange { marked_id, now }
        FilterChange { id, filter }
        Located { low, shape }
        Level { dims, shift, first_cell, unused }
        Params {
            origin, scale, clamp_low, boxes, clamp_high, levels, cells, small_cell, columns, flags, split,
            entry_capacity, slot_capacity, small_capacity, large_capacity, known, box_changes, filter_changes, pair_capacity,
            most_tests, unused, level
        }
        Chunk { first_small, small_items, first_large, large_items, word_capacity, unused, pairs_left }
        Cell { residents, visitors }
        Slot { start, shape, first_pair }
        SmallItem { slot, slots, first_pair, pairs }
        LargeItem { start, boxes, residents, row, column, end_column }
        Counters { entries, slots, small_items, large_items, valid, tests, unused, too_many_tests }
        Totals { words, pairs, made, redundant, overlaps, sorted, unused }
    }
}

/// Returns the Rust field that begins at a member of WGSL. In Rust padding is one array, and a filter is one struct.
fn field_of(member: &str) -> Option<&str> {
    match member {
        "unused0" => Some("unused"),
        "filter0" => Some("filter"),
        "unused1" | "unused2" | "filter1" | "filter2" | "filter3" => None,
        other => Some(other),
    }
}

fn module_of(kernel: &Kernel) -> naga::Module {
    let parsed = naga::front::wgsl::parse_str(&kernel.source(true));
    parsed.unwrap_or_else(|error| panic!("{}: {error}", kernel.name))
}

/// Returns the fields and the size of a struct of a module.
fn struct_of<'a>(module: &'a naga::Module, name: &str) -> Option<(Vec<(&'a str, usize)>, usize)> {
    let named = module.types.iter().find(|(_, ty)| ty.name.as_deref() == Some(name));
    let naga::TypeInner::Struct { members, span } = &named?.1.inner else { return None };
    let field = |member: &'a naga::StructMember| {
        let name = member.name.as_deref().expect("members of WGSL have names");
        Some((field_of(name)?, member.offset as usize))
    };
    Some((members.iter().filter_map(field).collect(), *span as usize))
}

#[test]
fn structs_lie_in_memory_as_in_the_kernels() {
    for kernel in all_kernels() {
        let module = module_of(kernel);
        for shared in shared_structs() {
            let found = struct_of(&module, shared.name);
            let wanted = Some((shared.fields, shared.size));
            assert_eq!(found, wanted, "{}: {}", kernel.name, shared.name);
        }
    }
}

/// Returns the value of a named constant of a kernel, if it has it.
fn constant_of(module: &naga::Module, name: &str) -> Option<u32> {
    let (_, constant) = module.constants.iter().find(|(_, c)| c.name.as_deref() == Some(name))?;
    match module.global_expressions[constant.init] {
        naga::Expression::Literal(naga::Literal::U32(value)) => Some(value),
        ref other => panic!("{name} is {other:?}"),
    }
}

#[test]
fn constants_are_those_of_the_kernels() {
    let everywhere = [
        ("LANES", LANES),
        ("GROUPS_PER_ROW", GROUPS_PER_ROW),
        ("MAX_LEVELS", layout::MAX_LEVELS as u32),
        ("NO_LEVEL", NO_LEVEL),
        ("SPAN_BITS", SPAN_BITS),
        ("BOX_BITS", BOX_BITS),
        ("AXIS_BITS", AXIS_BITS),
        ("WAS_ABSENT", WAS_ABSENT),
        ("FILTERED", FILTERED),
        ("PACKED", PACKED),
        ("BITS", BITS),
        ("SORTED", layout::SORTED),
        ("COUNTED", COUNTED),
        ("ENDED", ENDED),
    ];
    let somewhere = [
        ("CELLS_PER_BLOCK", CELLS_PER_BLOCK),
        ("CELLS_PER_LANE", CELLS_PER_BLOCK / LANES),
        ("PLAIN", PLAIN),
        ("COUNTS_PER_BLOCK", COUNTS_PER_BLOCK),
        ("SHORT_ROW", SHORT_ROW),
        ("WINDOW", WINDOW),
        ("PIECE", PIECE),
        ("PIECES", PIECES),
        ("FIRST_PIECE", FIRST_PIECE),
    ];
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
        assert!(kernel.source(true).contains(&most_span), "{}", kernel.name);
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
    let rising = [
        f32::NEG_INFINITY,
        f32::MIN,
        -1.0,
        -f32::MIN_POSITIVE,
        -1e-45,
        0.0,
        1e-45,
        f32::MIN_POSITIVE,
        1.0,
        f32::MAX,
        f32::INFINITY,
    ];
    assert!(rising.windows(2).all(|two| layout::ordered(two[0]) < layout::ordered(two[1])));
    assert_eq!(layout::ordered(-0.0), layout::ordered(0.0));
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
