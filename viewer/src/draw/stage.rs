//! Meshes, ground and light of a scene.

use super::linear;
use crate::framing::Framing;
use crate::palette::Rgb;
use crate::shapes::{self, Instance, KINDS, Surface};
use kiss3d::prelude::{Color, Fog, InstanceData3d, Light, Mat3, SceneNode3d, Vec3, Window};
use pbig_scenes::drawn::{Drawn, Kind};
use pbig_scenes::world::World;

/// The sky, and what far ground fades into.
const SKY: Rgb = [0.86, 0.91, 0.96];
/// The two greys of the ground.
const GROUND: [f32; 2] = [0.74, 0.80];
/// Tiles of the ground on each axis.
const GROUND_TILES: i32 = 64;
/// The edge of a tile, as a share of the radius of what is seen.
const TILE_SHARE: f32 = 0.16;
/// The opacity of sensors.
const SENSOR_ALPHA: f32 = 0.3;
/// Longitudes and latitudes of a ball. Balls are small on the screen, and drawn by the ten thousand.
const BALL_PARTS: [u32; 2] = [14, 8];

/// The nodes that kiss3d draws.
pub(super) struct Stage {
    pub(super) root: SceneNode3d,
    solids: [SceneNode3d; KINDS.len()],
    sensors: [SceneNode3d; KINDS.len()],
}

impl Stage {
    /// Builds what does not move, and empty sets of instances.
    pub(super) fn new(window: &mut Window, world: &World, drawn: &Drawn, framing: &Framing) -> Self {
        set_light(window, framing);
        let mut root = SceneNode3d::empty();
        let sun = Light::directional(Vec3::new(-0.55, -1.0, -0.25)).with_intensity(2.6);
        root.add_light(sun);
        let fill =
            Light::directional(Vec3::new(0.8, -0.3, -0.6)).with_intensity(0.7).with_casts_shadows(false);
        root.add_light(fill);
        if shapes::has_ground(drawn) {
            add_ground(&mut root, framing);
        }
        shapes::surfaces(world, drawn).into_iter().for_each(|surface| add_surface(&mut root, surface));
        let solids = KINDS.map(|kind| add_mesh(&mut root, kind));
        let sensors = KINDS.map(|kind| {
            add_mesh(&mut root, kind)
                .set_color(Color::new(1.0, 1.0, 1.0, SENSOR_ALPHA))
                .set_casts_shadows(false)
        });
        Self { root, solids, sensors }
    }

    /// Places the instances of this frame.
    pub(super) fn show(&mut self, instances: &[Instance]) {
        for (nodes, is_sensor) in [(&mut self.solids, false), (&mut self.sensors, true)] {
            for (node, kind) in nodes.iter_mut().zip(KINDS) {
                let shown = instances.iter().filter(|i| i.kind == kind && i.is_sensor == is_sensor);
                place(node, &shown.map(instance).collect::<Vec<_>>());
            }
        }
    }
}

/// Sets sky, fog and shadows to the size of what is seen.
fn set_light(window: &mut Window, framing: &Framing) {
    window.set_background_color(linear(SKY, 1.0));
    window.set_ambient(0.42);
    window.set_fog(Fog::linear(linear(SKY, 1.0), 4.0 * framing.radius, 9.0 * framing.radius));
    window.set_shadows_enabled(true);
    window.set_shadow_distance(6.0 * framing.radius);
    window.set_first_cascade_far_bound(3.0 * framing.radius);
}

fn place(node: &mut SceneNode3d, instances: &[InstanceData3d]) {
    node.set_visible(!instances.is_empty());
    if !instances.is_empty() {
        node.set_instances(instances);
    }
}

/// Adds a node of one of [`KINDS`], whose instances have no place yet.
fn add_mesh(root: &mut SceneNode3d, kind: Kind) -> SceneNode3d {
    let [around, up] = BALL_PARTS;
    let mut node = match kind {
        Kind::Ball => root.add_sphere_with_subdiv(1.0, around, up),
        Kind::Cylinder => root.add_cylinder_with_subdiv(1.0, 2.0, around),
        _ => root.add_cube(2.0, 2.0, 2.0),
    };
    node.set_roughness(0.7).set_visible(false)
}

fn add_ground(root: &mut SceneNode3d, framing: &Framing) {
    let (edge, half) = (TILE_SHARE * framing.radius, GROUND_TILES / 2);
    let thick = 0.1 * edge;
    let tile = |x: i32, z: i32| InstanceData3d {
        position: Vec3::new(framing.at[0] + x as f32 * edge, -0.5 * thick, framing.at[2] + z as f32 * edge),
        deformation: Mat3::from_diagonal(Vec3::new(edge, thick, edge)),
        color: grey(GROUND[(x + z).rem_euclid(2) as usize]),
        ..InstanceData3d::default()
    };
    let tiles: Vec<_> = (-half..half).flat_map(|x| (-half..half).map(move |z| tile(x, z))).collect();
    // A plane casts no shadow that could be seen, and would enlarge the area that shadows have to cover.
    place(&mut root.add_cube(1.0, 1.0, 1.0).set_roughness(0.9).set_casts_shadows(false), &tiles);
}

fn add_surface(root: &mut SceneNode3d, Surface { vertices, triangles }: Surface) {
    let vertices = vertices.into_iter().map(Vec3::from_array).collect();
    let mut node = SceneNode3d::trimesh(vertices, triangles, Vec3::ONE, true);
    // Rapier's triangles may face down.
    node.set_color(grey(GROUND[1])).set_roughness(0.9).enable_backface_culling(false);
    root.add_child(node);
}

fn grey(light: f32) -> Color {
    linear([light, light, light * 1.02], 1.0)
}

fn instance(instance: &Instance) -> InstanceData3d {
    let alpha = if instance.is_sensor { SENSOR_ALPHA } else { 1.0 };
    InstanceData3d {
        position: Vec3::from_array(instance.position),
        deformation: Mat3::from_cols_array_2d(&instance.columns),
        color: linear(instance.colour, alpha),
        ..InstanceData3d::default()
    }
}
