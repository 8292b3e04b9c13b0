//! Draws a simulation with kiss3d, in a window or without one.

mod overlay;
mod stage;

use crate::controls::Controls;
use crate::framing::{FIELD_OF_VIEW, Framing};
use crate::palette::{Palette, Rgb};
use crate::shapes;
use crate::sheet::Sheet;
use crate::simulation::{Ball, Simulation};
use kiss3d::prelude::{
    Camera3d, CanvasSetup, Color, CoordinateSystem2d, FixedView2d, NumSamples, OrbitCamera3d, Vec3, Window,
};
use overlay::Overlay;
use pbig_scenes::drawn::Drawn;
use stage::Stage;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quality {
    /// Smooth edges and sharp shadows.
    Fine,
    /// For a window on a software adapter, which draws on the CPU.
    Fast,
}

impl Quality {
    /// Returns the set-up of a window or of pictures.
    pub fn canvas_setup(self) -> CanvasSetup {
        let samples = if self == Self::Fine { NumSamples::Four } else { NumSamples::One };
        CanvasSetup { samples, ..CanvasSetup::default() }
    }

    /// Returns the edge of a shadow map, in pixels.
    fn shadow_pixels(self) -> u32 {
        if self == Self::Fine { 2048 } else { 512 }
    }
}

/// A scene's meshes, light and camera, and what is written over them.
pub struct View {
    drawn: Drawn,
    stage: Stage,
    overlay: Overlay,
    camera: OrbitCamera3d,
    flat_camera: FixedView2d,
    radius: f32,
    quality: Quality,
    /// The name of the scene for which the stage was built. A reset builds the same scene, and needs no new stage.
    scene: &'static str,
}

impl View {
    /// Prepares to draw the world of a simulation.
    pub fn new(window: &mut Window, simulation: &Simulation, quality: Quality) -> Self {
        window.set_shadow_resolution(quality.shadow_pixels());
        let (framing, drawn) = (Framing::of(&simulation.world), Drawn::new(&simulation.world));
        let stage = Stage::new(window, &simulation.world, &drawn, &framing);
        let flat_camera = FixedView2d::new(CoordinateSystem2d::TopLeftDown, false);
        let scene = simulation.setting.scene.name;
        Self {
            drawn,
            stage,
            overlay: Overlay::new(),
            camera: camera(&framing),
            flat_camera,
            radius: framing.radius,
            quality,
            scene,
        }
    }

    /// Returns a ball that flies from the camera to what it looks at.
    pub fn ball(&self) -> Ball {
        let (eye, at) = (self.camera.eye().to_array(), self.camera.at().to_array());
        Framing { eye, at, radius: self.radius }.ball()
    }

    /// Draws one frame. Returns false once the window is closed.
    pub async fn render(
        &mut self,
        window: &mut Window,
        simulation: &Simulation,
        controls: &Controls,
        sheet: &Sheet,
    ) -> bool {
        if self.scene != simulation.setting.scene.name {
            *self = Self::new(window, simulation, self.quality);
        }
        self.show(simulation, controls);
        self.overlay.show(window, sheet);
        let scenes = (Some(&mut self.stage.root), Some(&mut self.overlay.root));
        window
            .render(scenes.0, scenes.1, Some(&mut self.camera), Some(&mut self.flat_camera), None, None)
            .await
    }

    fn show(&mut self, simulation: &Simulation, controls: &Controls) {
        let palette = Palette::new(controls.colouring, &simulation.world);
        if self.drawn.is_outdated(&simulation.world) {
            self.drawn = Drawn::new(&simulation.world);
        }
        self.stage.show(&shapes::instances(&simulation.world, &self.drawn, &palette));
    }
}

fn camera(framing: &Framing) -> OrbitCamera3d {
    let [eye, at] = [framing.eye, framing.at].map(Vec3::from_array);
    let distance = eye.distance(at);
    OrbitCamera3d::new_with_frustum(FIELD_OF_VIEW, 2e-3 * distance, 20.0 * distance, eye, at)
}

/// Returns a colour for what kiss3d lights and encodes for the screen, which is all but texts. Our colours are already encoded.
fn linear([red, green, blue]: Rgb, alpha: f32) -> Color {
    let [red, green, blue] = [red, green, blue].map(|part: f32| part.powf(2.2));
    Color::new(red, green, blue, alpha)
}
