//! The shapes and histories that are known to be hard.

use super::{Change, History, MEANT_FOR, Part, Placement, Recipe};

const CUBES: Part = Part::CUBES;

/// Returns boxes anywhere in a region at the origin.
const fn part(width: [f32; 3], half: [f32; 3]) -> Part {
    Part { width, half, ..CUBES }
}

/// Moves a part's region.
const fn at(corner: [f32; 3], part: Part) -> Part {
    Part { corner, ..part }
}

/// Changes a part's share of the boxes.
const fn share(weight: u32, part: Part) -> Part {
    Part { weight, ..part }
}

/// Changes the power with which a part's widths grow with the number of boxes.
const fn growing(growth: f32, part: Part) -> Part {
    Part { growth, ..part }
}

/// Lays boxes along the diagonal of a region, which grows with their number.
const fn line(width: [f32; 3], half: [f32; 3]) -> Part {
    Part { place: Placement::Line, ..growing(1.0, part(width, half)) }
}

const fn lattice(width: [f32; 3], half: [f32; 3]) -> Part {
    Part { place: Placement::Lattice, ..part(width, half) }
}

/// Returns boxes whose sizes differ by decades.
const fn mixed(decades: f32, part: Part) -> Part {
    Part { decades, ..part }
}

/// Shapes for which a grid of one cell size takes quadratic time, and their neighbours.
pub fn shapes() -> Vec<(&'static str, Recipe)> {
    const INFINITE: f32 = f32::INFINITY;
    let needles = |axis: usize, thick: f32| {
        let mut part = part(CUBES.width, [thick; 3]);
        (part.half[axis], part.width[axis]) = (1000.0, 0.0);
        part
    };
    let slab = |z: f32| at([0.0, 0.0, z], part([100.0, 100.0, 3.0], [0.3; 3]));
    let [x, y, z] = [0, 1, 2].map(|axis| needles(axis, 0.01));
    let clump = at([50.0; 3], growing(0.0, part([0.01; 3], [5e-6; 3])));
    let tile = |axis: usize| {
        let mut tile = share(5, part([290.0; 3], CUBES.half));
        tile.half[axis] = 1e-7;
        tile
    };
    let lath = |half: [f32; 3]| mixed(1.0, part([1000.0; 3], half));
    let small = |width: f32, half: f32| growing(0.0, part([width; 3], [half; 3]));
    let sheets =
        |x: f32| at([x, 0.0, 0.0], share(150, growing(0.5, part([3.0, 130.0, 130.0], [1e-5, 0.4, 0.4]))));
    let sheet = |x: f32, weight: u32, width: f32, half: [f32; 3]| {
        at([x, 65.0, 65.0], share(weight, growing(0.5, part([width, 0.0, 0.0], half))))
    };
    let around = Part { place: Placement::Around, ..small(1e5, 2e3) };
    let worlds: [(&str, &[Part]); 24] = [
        ("uniform", &[CUBES]),
        ("two scales", &[part([1000.0; 3], CUBES.half), small(0.01, 5e-6)]),
        ("size by distance", &[around]),
        ("tiny ones in the volume of one", &[CUBES, small(0.9, 5e-4)]),
        ("infinite needles far away", &[CUBES, at([0.0, 1e4, 0.0], part(CUBES.width, [INFINITE, 0.1, 0.1]))]),
        ("mixed sizes above 2^100", &[mixed(3.0, part([3e34; 3], [1e33; 3]))]),
        (
            "a slab with sheets in its gap",
            &[
                share(5, slab(0.0)),
                share(4, slab(100.0)),
                at([0.0, 0.0, 20.0], part([0.0, 0.0, 60.0], [100.0, 100.0, 1e-5])),
            ],
        ),
        ("a diagonal line", &[line([MEANT_FOR as f32; 3], [0.4; 3])]),
        ("needles that do not cross", &[x, at([0.0, 0.0, 1e4], y)]),
        ("needles between needles", &[needles(0, 1e-4), needles(1, 1e-4)]),
        ("needles in three directions", &[x, y, z]),
        ("gravel and crates", &[part([3.0; 3], [0.05; 3]), part([600.0; 3], [1.0; 3])]),
        ("denormal numbers", &[part([3e-39; 3], [3e-41; 3])]),
        ("some far away", &[share(30, CUBES), small(1e9, CUBES.half[0])]),
        ("sizes over two decades", &[mixed(2.0, part([150.0; 3], [1.0; 3]))]),
        (
            "sheets in three directions",
            &[
                part([600.0; 3], [60.0, 60.0, 1e-4]),
                part([600.0; 3], [60.0, 1e-4, 60.0]),
                part([600.0; 3], [1e-4, 60.0, 60.0]),
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
                sheets(0.0),
                sheets(7.0),
                at([5.0, 65.0, 65.0], growing(0.5, part([0.2, 0.0, 0.0], [1e-3, 130.0, 130.0]))),
            ],
        ),
        ("a lattice that touches", &[lattice([29.0; 3], CUBES.half)]),
        (
            "all on one plane of a huge floor",
            &[share(50, part([300.0, 300.0, 0.0], CUBES.half)), part(CUBES.width, [1e6, 1e6, 1.0])],
        ),
        // Like one found by search: only cuts across y tell those along x from those along z. Those along y are far away.
        (
            "needles in three directions, those along y apart",
            &[
                share(3, part([0.0, 85.0, 28.0], [1e6, 1e-4, 1e-4])),
                at([-2000.0, 0.0, 86.0], part([1000.0, 0.0, 17.0], [0.01, 100.0, 0.01])),
                at([1000.0, 10.0, 0.0], part([2000.0, 55.0, 0.0], [1e-4, 1e-4, 4e4])),
            ],
        ),
        // Like one found by search: nothing but the thin axis tells them apart.
        (
            "needles in a thin world",
            &[at([0.47, 1.3, 0.0], mixed(2.1, line([0.02, 2200.0, 0.01], [8e-7, 3000.0, 55.0])))],
        ),
        // Found by search: with 10,000 boxes the oversize ones cross many rows of empty cells. Fewer digits make another world.
        (
            "tiny tiles among sheets",
            &[
                mixed(
                    0.040395737,
                    Part {
                        weight: 150,
                        corner: [7.0019517, 0.0723704, 0.0],
                        width: [0.0021275363, 0.101915136, 0.1538184],
                        half: [1.0353697e-10, 0.0029106543, 0.0008135489],
                        growth: 0.5,
                        ..CUBES
                    },
                ),
                mixed(1.7322884, sheet(383.4098, 2, 132.27032, [0.0003539665, 80_001.45, 4800.538])),
                Part {
                    place: Placement::Line,
                    ..sheet(6.4418683, 6, 0.24045853, [0.00017519857, 147_902.34, 4539.5073])
                },
                mixed(2.8373046, sheet(5.0, 2, 0.69801897, [0.0010956939, 1_903_660.3, 318.9507])),
            ],
        ),
    ];
    worlds.map(|(name, parts)| (name, Recipe(parts.to_vec()))).into()
}

/// Histories after which a structure that is kept and changed again and again may take quadratic time.
pub fn histories() -> Vec<(&'static str, History)> {
    let history =
        |start: &[Part], change: Change| History { start: Recipe(start.to_vec()), change, updates: 25 };
    let cubes = lattice([45.0; 3], [0.3; 3]);
    let to = |part: Part| Change::To(Recipe(vec![part]));
    let tiny = at([20.0; 3], growing(0.0, part([0.9; 3], [1e-3; 3])));
    let long = line([MEANT_FOR as f32; 3], [0.3; 3]);
    // Found by search: a cube that meets all tiny ones must not pay for the others that meet none.
    let tiny_lattice = share(14, lattice([0.1, 0.2, 0.2], [1.4e-3; 3]));
    let crowd = [lattice([45.0, 45.0, 330.0], [0.3; 3]), tiny_lattice];
    let moved = history(&crowd, Change::Shift([800.0, 24_000.0, 0.07]));
    // Found by search: what the last search took says nothing when most of its pairs have ended.
    let sheets = mixed(3.5, part([20.0, 180.0, 690.0], [3e3, 5e-5, 2e4]));
    let ended = history(&[line([1.4, 0.7, 0.5], [0.01; 3])], Change::To(Recipe(vec![long, sheets])));
    let changes = [
        ("cubes that turn", Change::Grow(1.2)),
        ("cubes that double", Change::Grow(2.0)),
        ("4 km along one axis", Change::Shift([4000.37, 0.0, 0.0])),
        ("10 km along all axes", Change::Shift([1e4; 3])),
        ("tiny ones that gather", to(tiny)),
        ("out along a line", to(long)),
        ("mixed up", to(part([45.0; 3], [0.3; 3]))),
        ("removed", Change::Remove),
    ];
    let found =
        [("a crowd within a cube, moved", moved), ("a crowd that becomes a line among sheets", ended)];
    changes.map(|(name, change)| (name, history(&[cubes], change))).into_iter().chain(found).collect()
}
