//! The list of scenes.

use super::{Scene, asteroids, conveyor, falling, filtered, jar, ragdolls, resting};

/// Makes the list of rows: name, default number of bodies, builder; a description; what is hard.
macro_rules! scenes {
    ($($name:literal $default_bodies:literal $build:expr, $about:literal, $hard:literal;)*) => {
        [$(Self { name: $name, about: $about, hard: $hard, default_bodies: $default_bodies, build: $build }),*]
    };
}

impl Scene {
    /// Every scene.
    pub const ALL: [Self; 18] = scenes! {
        "column" 1000 falling::column,
            "spheres, cubes and slabs fall in a column onto a plane (Avril, figure 1)",
            "all boxes move at first, then rest in a heap";
        "spheres" 1000 |b, n| falling::fall(b, n, falling::sphere),
            "the column with spheres alone",
            "boxes of about one size, which roll apart";
        "cubes" 1000 |b, n| falling::fall(b, n, falling::cube),
            "the column with cubes alone",
            "boxes that grow and shrink as cubes tumble";
        "slabs" 1000 |b, n| falling::fall(b, n, falling::slab),
            "the column with slabs alone",
            "flat boxes, long one way and short the other";
        "columns" 3000 falling::columns,
            "columns of spheres, of cubes and of slabs fall side by side (Avril, figure 1)",
            "crowds with empty space between them";
        "pile" 1000 resting::pile,
            "cubes stacked close together settle and fall asleep",
            "many pairs a box, all of them kept";
        "pyramid" 650 resting::pyramid,
            "a pyramid of cubes at rest",
            "boxes that touch exactly, and hardly move";
        "mixed" 600 falling::mixed,
            "sizes from 0.05 to 50 fall together",
            "large boxes beside small ones";
        "jar" 1500 jar::jar,
            "balls and cubes of mixed sizes fall into a jar",
            "small boxes crowded between larger ones";
        "city" 3000 resting::city,
            "fixed blocks in streets, few movers among them",
            "many boxes of which few move";
        "rain" 1500 falling::rain,
            "small drops fall fast over a wide, hilly ground, thinly spread",
            "fast boxes in much empty space";
        "asteroids" 1500 asteroids::asteroids,
            "asteroids of many sizes circle and collide, pulled to the middle",
            "sizes from 0.2 to 15 in all directions, none at rest";
        "ragdolls" 660 ragdolls::ragdolls,
            "figures of eleven jointed parts fall over each other",
            "small boxes that overlap by their joints, and are no contacts";
        "conveyor" 1400 conveyor::conveyor,
            "rollers carry crates around in rings, through gates, which are sensors",
            "sensors that boxes enter and leave all the time";
        "sensors" 800 filtered::sensors,
            "spheres fall through layers of sensors, some that see fixed bodies too",
            "pairs of sensors and of fixed boxes";
        "compounds" 500 falling::compounds,
            "bodies of several colliders, and compound shapes, fall",
            "boxes of one body, whose overlaps are no pairs";
        "sleeping" 20_000 resting::sleeping,
            "one awake body among sleeping ones",
            "one box that moves among many that do not";
        "groups" 800 filtered::groups,
            "crowds in groups that ignore each other, kinematic bodies and moving walls",
            "boxes in one place that are no pairs";
    };
}
