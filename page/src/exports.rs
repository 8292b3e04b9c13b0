//! The functions that JavaScript calls.

use crate::choice::Choice;
use crate::run::Run;
use pbig_scenes::drawn::{Drawn, Kind, Member, Triangles};
use pbig_scenes::scenes::Scene;
use pbig_scenes::times::StepTime;
use rapier3d::na::Matrix4;
use std::sync::{Mutex, PoisonError};
use wasm_bindgen::prelude::*;

static PANIC: Mutex<String> = Mutex::new(String::new());

/// Keeps the message of a panic for [`panic_message`]: a panic ends the module in a trap without words.
#[wasm_bindgen(start)]
pub fn keep_panics() {
    std::panic::set_hook(Box::new(|panic| {
        *PANIC.lock().unwrap_or_else(PoisonError::into_inner) = panic.to_string();
    }));
}

/// Returns the message of the panic that ended the module; empty without one.
#[wasm_bindgen]
pub fn panic_message() -> String {
    PANIC.lock().unwrap_or_else(PoisonError::into_inner).clone()
}

/// A scene that can be chosen.
#[wasm_bindgen(getter_with_clone)]
pub struct SceneInfo {
    /// Name in [`Simulation::new`].
    pub name: String,
    /// Description in a few words.
    pub about: String,
    /// Property that makes it hard for a broad phase.
    pub hard: String,
}

/// Returns every scene.
#[wasm_bindgen]
pub fn scenes() -> Vec<SceneInfo> {
    let info = |scene: &Scene| SceneInfo {
        name: scene.name.into(),
        about: scene.about.into(),
        hard: scene.hard.into(),
    };
    Scene::ALL.iter().map(info).collect()
}

/// Triangles of a shape that is drawn as a mesh.
#[wasm_bindgen(getter_with_clone)]
pub struct MeshData {
    /// Three coordinates of each vertex.
    pub coordinates: Vec<f32>,
    /// Three vertices of each triangle.
    pub indices: Vec<u32>,
}

/// Parts that one instanced call draws.
#[wasm_bindgen(getter_with_clone)]
pub struct GroupData {
    /// `ball`, `cuboid`, `cylinder`, `half-space` or `mesh`.
    pub kind: String,
    /// Number of the mesh, if the kind is `mesh`.
    pub mesh: Option<u32>,
    /// True for parts that are drawn translucent.
    pub is_translucent: bool,
    /// Number of parts.
    pub count: u32,
}

/// A running scene.
#[wasm_bindgen]
pub struct Simulation {
    run: Run,
    drawn: Drawn,
    advanced: Result<StepTime, String>,
    time: StepTime,
}

#[wasm_bindgen]
impl Simulation {
    /// Builds a scene with about this many bodies. The broad phase is `stock`, `pbig` or `gpu`.
    ///
    /// # Errors
    /// A text that lists the right names if one is wrong.
    #[wasm_bindgen(constructor)]
    pub fn new(scene: &str, bodies: u32, seed: u32, broad_phase: &str) -> Result<Self, JsError> {
        let choice: Choice = broad_phase.parse().map_err(to_js)?;
        let run = Run::new(scene, bodies as usize, seed.into(), choice).map_err(to_js)?;
        let (drawn, time) = (Drawn::new(&run.world), StepTime::default());
        Ok(Self { run, drawn, advanced: Ok(time), time })
    }

    /// Advances the world by 1/60 s. With the GPU this must be called so that it can be suspended: by
    /// `WebAssembly.promising`, which knows numbers alone. So [`Simulation::end_step`] has the result.
    pub fn advance(&mut self) {
        self.advanced = self.run.step();
    }

    /// Ends a step. Returns true if colliders were added or removed, so that the groups are new.
    ///
    /// # Errors
    /// The text of pbig's error.
    pub fn end_step(&mut self) -> Result<bool, JsError> {
        self.time = self.advanced.clone().map_err(to_js)?;
        let is_outdated = self.drawn.is_outdated(&self.run.world);
        if is_outdated {
            self.drawn = Drawn::new(&self.run.world);
        }
        Ok(is_outdated)
    }

    /// Changes the broad phase to `stock`, `pbig` or `gpu` while the world runs.
    ///
    /// # Errors
    /// A text that lists the right names.
    pub fn change_broad_phase(&mut self, broad_phase: &str) -> Result<(), JsError> {
        self.run.change_broad_phase(broad_phase.parse().map_err(to_js)?);
        Ok(())
    }

    /// Returns the milliseconds of the broad phase in the last step.
    pub fn broad_phase_ms(&self) -> f64 {
        self.time.broad_phase
    }

    /// Returns the milliseconds of the last step, the broad phase included.
    pub fn step_ms(&self) -> f64 {
        self.time.step
    }

    /// Returns the number of steps so far.
    pub fn steps(&self) -> u32 {
        self.run.steps()
    }

    /// Returns the number of pairs that the broad phase reported.
    pub fn pair_count(&self) -> u32 {
        self.run.world.pair_count() as u32
    }

    /// Returns the number of rigid bodies.
    pub fn body_count(&self) -> u32 {
        self.run.world.bodies.len() as u32
    }

    /// Returns pbig's algorithm and the reason for it; empty with rapier's own broad phase.
    pub fn plan(&self) -> String {
        self.run.plan()
    }

    /// Returns the indices of the colliders of each pair, one pair after another, sorted.
    pub fn pairs(&self) -> Vec<u32> {
        self.run.pairs().into_flattened()
    }

    /// Returns the centre and the half extents, in metres, of a box around the bodies that can move: six coordinates.
    pub fn moving_box(&self) -> Vec<f32> {
        let around = self.run.world.moving_aabb();
        let (centre, half) =
            around.map_or_else(Default::default, |it| (it.center().coords, it.half_extents()));
        vec![centre.x, centre.y, centre.z, half.x, half.y, half.z]
    }

    /// Returns the groups of parts.
    pub fn groups(&self) -> Vec<GroupData> {
        self.drawn.groups().map(group_data).collect()
    }

    /// Returns the meshes that groups name by number.
    pub fn meshes(&self) -> Vec<MeshData> {
        self.drawn.meshes.iter().map(mesh_data).collect()
    }

    /// Returns the colour class of each part, group by group.
    pub fn colours(&self) -> Vec<u8> {
        self.drawn.members.iter().map(|member| member.part.colour as u8).collect()
    }

    /// Returns a matrix of 16 floats for each part, group by group, column by column.
    pub fn matrices(&self) -> Vec<f32> {
        let mut floats = Vec::with_capacity(16 * self.drawn.members.len());
        for Member { collider, part, .. } in &self.drawn.members {
            let collider = self.run.world.colliders.get(*collider);
            floats.extend_from_slice(collider.map_or_else(Matrix4::zeros, |it| part.matrix(it)).as_slice());
        }
        floats
    }
}

fn group_data(members: &[Member]) -> GroupData {
    let (kind, mesh) = match members[0].part.kind {
        Kind::Ball => ("ball", None),
        Kind::Cuboid => ("cuboid", None),
        Kind::Cylinder => ("cylinder", None),
        Kind::HalfSpace => ("half-space", None),
        Kind::Mesh(number) => ("mesh", Some(number)),
    };
    let (is_translucent, count) = (members[0].is_translucent, members.len() as u32);
    GroupData { kind: kind.into(), mesh, is_translucent, count }
}

fn mesh_data((points, triangles): &Triangles) -> MeshData {
    let coordinates = points.iter().flat_map(|point| [point.x, point.y, point.z]).collect();
    MeshData { coordinates, indices: triangles.as_flattened().to_vec() }
}

fn to_js(message: String) -> JsError {
    JsError::new(&message)
}
