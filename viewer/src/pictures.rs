//! Pictures without a window.

use crate::choice::Choice;
use crate::controls::Controls;
use crate::draw::{Quality, View};
use crate::figures::Figures;
use crate::graph::scale_end_ms;
use crate::hud::{self, HudSide};
use crate::options::Options;
use crate::sheet::Sheet;
use crate::simulation::Simulation;
use image::RgbImage;
use kiss3d::window::Window;
use std::path::Path;

/// Writes a picture of every n-th step into a folder, as `00000.png` and so on by the number of steps.
///
/// # Errors
/// If a picture cannot be written, or the broad phase fails in a step.
pub async fn run(options: &Options, folder: &Path) -> Result<(), String> {
    let mut studio = Studio::new(options).await;
    for step in 0..=options.steps {
        if step > 0 {
            studio.step()?;
        }
        if step % options.every == 0 {
            save(&studio.picture().await, &folder.join(format!("{step:05}.png")))?;
        }
    }
    println!("{} pictures in {}", options.steps / options.every + 1, folder.display());
    Ok(())
}

/// Writes a PNG file, and the folders above it if they are missing.
///
/// # Errors
/// If it cannot be written.
pub fn save(picture: &RgbImage, path: &Path) -> Result<(), String> {
    let folder = path.parent().unwrap_or(Path::new("."));
    std::fs::create_dir_all(folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    picture.save(path).map_err(|error| format!("{}: {error}", path.display()))
}

/// One simulation, or two beside each other, drawn without a window.
struct Studio {
    window: Window,
    sides: Vec<(Simulation, View)>,
    controls: Controls,
    has_comparison: bool,
}

impl Studio {
    async fn new(options: &Options) -> Self {
        let choices =
            if options.compare { vec![Choice::Stock, pbig(options.backend)] } else { vec![options.backend] };
        let [width, height] = options.size;
        let mut window = Window::new_headless_with_setup(
            width / choices.len() as u32,
            height,
            Quality::Fine.canvas_setup(),
        )
        .await;
        let mut side = |choice| {
            let simulation = Simulation::new(options.setting(), choice);
            let view = View::new(&mut window, &simulation, Quality::Fine);
            (simulation, view)
        };
        let sides = choices.into_iter().map(&mut side).collect();
        let controls = Controls { is_help_shown: false, ..Controls::new(options.colour) };
        Self { window, sides, controls, has_comparison: options.compare }
    }

    /// Makes one step on each side in turn, so that both see the same noise of the machine.
    fn step(&mut self) -> Result<(), String> {
        step_all(self.sides.iter_mut().map(|(simulation, _)| simulation))
    }

    /// Draws all sides, left to right.
    async fn picture(&mut self) -> RgbImage {
        let mut halves = Vec::new();
        for i in 0..self.sides.len() {
            let sheet = self.sheet(i);
            let (simulation, view) = &mut self.sides[i];
            view.render(&mut self.window, simulation, &self.controls, &sheet).await;
            halves.push(self.window.snap_image());
        }
        beside(&halves)
    }

    fn sheet(&self, i: usize) -> Sheet {
        let simulation = &self.sides[i].0;
        let size = [self.window.width() as f32, self.window.height() as f32];
        if !self.has_comparison {
            let figures = Figures::of(simulation, &self.controls);
            return hud::viewer(&figures, &simulation.history, &self.controls, size);
        }
        let longest =
            self.sides.iter().map(|(side, _)| side.history.longest_broad_phase_ms()).fold(0.0, f64::max);
        let title = format!("step {}: broad phase, ms a step", simulation.steps);
        let (choice, history) = (simulation.choice, &simulation.history);
        hud::comparison(&HudSide { choice, history, end_ms: scale_end_ms(longest), title }, size)
    }
}

/// Makes one step of each simulation, and ends with the first that fails.
fn step_all<'a>(mut simulations: impl Iterator<Item = &'a mut Simulation>) -> Result<(), String> {
    simulations.try_for_each(|simulation| {
        simulation.step();
        simulation.check()
    })
}

/// Returns the choice for the right side of a comparison, which is not stock.
fn pbig(choice: Choice) -> Choice {
    if choice == Choice::Stock { Choice::default() } else { choice }
}

/// Returns one picture of pictures of the same height, left to right.
fn beside(pictures: &[RgbImage]) -> RgbImage {
    let width = pictures.iter().map(RgbImage::width).sum();
    let height = pictures.first().map_or(0, RgbImage::height);
    let (mut whole, mut x) = (RgbImage::new(width, height), 0);
    for picture in pictures {
        image::imageops::replace(&mut whole, picture, x, 0);
        x += i64::from(picture.width());
    }
    whole
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulation::{Setting, with_max_pairs};
    use image::Rgb;
    use pbig_scenes::scenes::Scene;

    #[test]
    fn a_step_fails_with_the_broad_phase_of_either_side() {
        let setting = Setting { scene: Scene::named("column").unwrap(), bodies: 200, seed: 1 };
        let mut sides = [Choice::Stock, Choice::Auto].map(|choice| Simulation::new(setting, choice));
        assert_eq!(step_all(sides.iter_mut()), Ok(()));
        sides[1].broad_phase = with_max_pairs(10);
        assert!(step_all(sides.iter_mut()).unwrap_err().starts_with("step 2: "));
    }

    #[test]
    fn pictures_stand_beside_each_other() {
        let [left, right] = [[1, 2, 3], [4, 5, 6]].map(|colour| RgbImage::from_pixel(2, 3, Rgb(colour)));
        let whole = beside(&[left, right]);
        assert_eq!(whole.dimensions(), (4, 3));
        assert_eq!((whole.get_pixel(1, 2).0, whole.get_pixel(2, 0).0), ([1, 2, 3], [4, 5, 6]));
    }

    #[test]
    fn a_picture_that_cannot_be_written_is_an_error_with_its_name() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        std::fs::write(&file, "").unwrap();
        let error = save(&RgbImage::new(1, 1), &file.join("x.png")).unwrap_err();
        assert!(error.contains("file"), "{error}");
        let deep = folder.path().join("a/b/x.png");
        save(&RgbImage::new(1, 1), &deep).unwrap();
        assert!(deep.exists());
    }
}
