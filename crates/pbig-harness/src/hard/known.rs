//! The shapes and histories that are known to be hard.

use super::{Change, History, MEANT_FOR, Part, Placement, Recipe};

/// Shapes for which a grid of one cell size takes quadratic time, and their neighbours.
pub fn shapes() -> Vec<(&'static str, Recipe)> {
    const CUBES: Part = Part::CUBES;
    const SMALL: Part = Part { growth: 0.0, ..CUBES };
    let needles = |axis: usize, corner: [f32; 3], thick: f32| {
        let mut part = Part { corner, half: [thick; 3], ..CUBES };
        (part.half[axis], part.width[axis]) = (1000.0, 0.0);
        part
    };
    let slab = |z: f32| Part { corner: [0.0, 0.0, z], width: [100.0, 100.0, 3.0], half: [0.3; 3], ..CUBES };
    let [x, y, z] = [0, 1, 2].map(|axis| needles(axis, [0.0; 3], 0.01));
    let clump = Part { corner: [50.0; 3], width: [0.01; 3], half: [5e-6; 3], growth: 0.0, ..CUBES };
    let tile = |axis: usize| {
        let mut part = Part { weight: 5, width: [290.0; 3], ..CUBES };
        part.half[axis] = 1e-7;
        part
    };
    let lath = |half: [f32; 3]| Part { width: [1000.0; 3], half, decades: 1.0, ..CUBES };
    let worlds: [(&str, &[Part]); 23] = [
        ("uniform", &[CUBES]),
        (
            "two scales",
            &[Part { width: [1000.0; 3], ..CUBES }, Part { width: [0.01; 3], half: [5e-6; 3], ..SMALL }],
        ),
        ("size by distance", &[Part { place: Placement::Around, width: [1e5; 3], half: [2e3; 3], ..SMALL }]),
        ("tiny ones in the volume of one", &[CUBES, Part { width: [0.9; 3], half: [5e-4; 3], ..SMALL }]),
        (
            "infinite needles far away",
            &[CUBES, Part { corner: [0.0, 1e4, 0.0], half: [f32::INFINITY, 0.1, 0.1], ..CUBES }],
        ),
        ("mixed sizes above 2^100", &[Part { width: [3e34; 3], half: [1e33; 3], decades: 3.0, ..CUBES }]),
        (
            "a slab with sheets in its gap",
            &[
                Part { weight: 5, ..slab(0.0) },
                Part { weight: 4, ..slab(100.0) },
                Part {
                    corner: [0.0, 0.0, 20.0],
                    width: [0.0, 0.0, 60.0],
                    half: [100.0, 100.0, 1e-5],
                    ..CUBES
                },
            ],
        ),
        (
            "a diagonal line",
            &[Part {
                place: Placement::Line,
                width: [MEANT_FOR as f32; 3],
                half: [0.4; 3],
                growth: 1.0,
                ..CUBES
            }],
        ),
        ("needles that do not cross", &[x, Part { corner: [0.0, 0.0, 1e4], ..y }]),
        ("needles between needles", &[needles(0, [0.0; 3], 1e-4), needles(1, [0.0; 3], 1e-4)]),
        ("needles in three directions", &[x, y, z]),
        (
            "gravel and crates",
            &[
                Part { width: [3.0; 3], half: [0.05; 3], ..CUBES },
                Part { width: [600.0; 3], half: [1.0; 3], ..CUBES },
            ],
        ),
        ("denormal numbers", &[Part { width: [3e-39; 3], half: [3e-41; 3], ..CUBES }]),
        ("some far away", &[Part { weight: 30, ..CUBES }, Part { width: [1e9; 3], ..SMALL }]),
        ("sizes over two decades", &[Part { width: [150.0; 3], half: [1.0; 3], decades: 2.0, ..CUBES }]),
        (
            "sheets in three directions",
            &[
                Part { half: [60.0, 60.0, 1e-4], width: [600.0; 3], ..CUBES },
                Part { half: [60.0, 1e-4, 60.0], width: [600.0; 3], ..CUBES },
                Part { half: [1e-4, 60.0, 60.0], width: [600.0; 3], ..CUBES },
            ],
        ),
        ("thin tiles and a crowd", &[tile(0), tile(1), tile(2), clump]),
        (
            "laths of all shapes and a crowd",
            &[
                lath([10.0, 1.0, 0.1]),
                lath([0.1, 10.0, 1.0]),
                lath([1.0, 0.01, 10.0]),
                lath([10.0, 10.0, 0.01]),
                clump,
            ],
        ),
        (
            "sheets in the gap of a flat world",
            &[
                Part {
                    weight: 150,
                    width: [3.0, 130.0, 130.0],
                    half: [1e-5, 0.4, 0.4],
                    growth: 0.5,
                    ..CUBES
                },
                Part {
                    weight: 150,
                    corner: [7.0, 0.0, 0.0],
                    width: [3.0, 130.0, 130.0],
                    half: [1e-5, 0.4, 0.4],
                    growth: 0.5,
                    ..CUBES
                },
                Part {
                    corner: [5.0, 65.0, 65.0],
                    width: [0.2, 0.0, 0.0],
                    half: [1e-3, 130.0, 130.0],
                    growth: 0.5,
                    ..CUBES
                },
            ],
        ),
        ("a lattice that touches", &[Part { place: Placement::Lattice, width: [29.0; 3], ..CUBES }]),
        (
            "all on one plane of a huge floor",
            &[
                Part { weight: 50, width: [300.0, 300.0, 0.0], ..CUBES },
                Part { half: [1e6, 1e6, 1.0], ..CUBES },
            ],
        ),
        // Like one found by search: only cuts across y tell those along x from those along z. Those along y are far away.
        (
            "needles in three directions, those along y apart",
            &[
                Part { weight: 3, width: [0.0, 85.0, 28.0], half: [1e6, 1e-4, 1e-4], ..CUBES },
                Part {
                    corner: [-2000.0, 0.0, 86.0],
                    width: [1000.0, 0.0, 17.0],
                    half: [0.01, 100.0, 0.01],
                    ..CUBES
                },
                Part {
                    corner: [1000.0, 10.0, 0.0],
                    width: [2000.0, 55.0, 0.0],
                    half: [1e-4, 1e-4, 4e4],
                    ..CUBES
                },
            ],
        ),
        // Like one found by search: nothing but the thin axis tells them apart.
        (
            "needles in a thin world",
            &[Part {
                place: Placement::Line,
                corner: [0.47, 1.3, 0.0],
                width: [0.02, 2200.0, 0.01],
                half: [8e-7, 3000.0, 55.0],
                decades: 2.1,
                growth: 1.0,
                ..CUBES
            }],
        ),
    ];
    worlds.map(|(name, parts)| (name, Recipe(parts.to_vec()))).into()
}

/// Histories after which a grid that is edited again and again takes quadratic time.
pub fn histories() -> Vec<(&'static str, History)> {
    let start =
        || Recipe(vec![Part { place: Placement::Lattice, width: [45.0; 3], half: [0.3; 3], ..Part::CUBES }]);
    let history = |change: Change| History { start: start(), change, updates: 25 };
    let part = |part: Part| Change::To(Recipe(vec![part]));
    let tiny = Part { corner: [20.0; 3], width: [0.9; 3], growth: 0.0, half: [1e-3; 3], ..Part::CUBES };
    let line = Part {
        place: Placement::Line,
        width: [MEANT_FOR as f32; 3],
        growth: 1.0,
        half: [0.3; 3],
        ..Part::CUBES
    };
    // Found by search: a cube that meets all tiny ones must not pay for the others that meet none.
    let lattice = Part { place: Placement::Lattice, ..Part::CUBES };
    let tiny_lattice = Part { weight: 14, width: [0.1, 0.2, 0.2], half: [1.4e-3; 3], ..lattice };
    let cubes = Part { width: [45.0, 45.0, 330.0], half: [0.3; 3], ..lattice };
    let crowd = Recipe(vec![cubes, tiny_lattice]);
    let change = Change::Shift([800.0, 24_000.0, 0.07]);
    let moved = ("a crowd within a cube, moved", History { start: crowd, change, updates: 25 });
    // Found by search: what the last rebuild took says nothing when most of its pairs have ended.
    let crowd = Recipe(vec![Part {
        place: Placement::Line,
        width: [1.4, 0.7, 0.5],
        growth: 1.0,
        half: [0.01; 3],
        ..Part::CUBES
    }]);
    let sheets = Part { width: [20.0, 180.0, 690.0], half: [3e3, 5e-5, 2e4], decades: 3.5, ..Part::CUBES };
    let change = Change::To(Recipe(vec![line, sheets]));
    let ended = ("a crowd that becomes a line among sheets", History { start: crowd, change, updates: 25 });
    let changes = [
        ("cubes that turn", Change::Grow(1.2)),
        ("cubes that double", Change::Grow(2.0)),
        ("4 km along one axis", Change::Shift([4000.37, 0.0, 0.0])),
        ("10 km along all axes", Change::Shift([1e4; 3])),
        ("tiny ones that gather", part(tiny)),
        ("out along a line", part(line)),
        ("mixed up", part(Part { width: [45.0; 3], half: [0.3; 3], ..Part::CUBES })),
        ("removed", Change::Remove),
    ];
    changes.map(|(name, change)| (name, history(change))).into_iter().chain([moved, ended]).collect()
}
