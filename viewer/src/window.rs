//! The viewer's window.

use crate::controls::{Action, Controls, action_of};
use crate::draw::{Quality, View};
use crate::error::Error;
use crate::figures::Figures;
use crate::hud;
use crate::options::Options;
use crate::pictures::save;
use crate::simulation::Simulation;
use kiss3d::event::{Action as KeyAction, WindowEvent};
use kiss3d::window::Window;

/// Opens a window and runs the scene in it until the window is closed. Prints the state after each key.
///
/// # Errors
/// If there is no display, or a picture cannot be written.
pub async fn run(options: &Options, quality: Quality) -> Result<(), Error> {
    check_display()?;
    let [width, height] = options.size;
    let mut window = Window::new_with_setup("pbig", width, height, quality.canvas_setup()).await;
    let mut simulation = Simulation::new(options.setting(), options.backend);
    let mut controls = Controls::new(options.colour, options.cells);
    let mut view = View::new(&mut window, &simulation, quality);
    println!("ready {}", controls.describe(&simulation));
    while !controls.is_ending && draw(&mut window, &mut view, &simulation, &controls).await {
        if std::mem::take(&mut controls.is_saving) {
            save_picture(options, &window)?;
        }
        if !controls.is_paused {
            simulation.step();
        }
        for action in actions(&window) {
            controls.obey(action, &mut simulation, view.ball());
            println!("{action:?} {}", controls.describe(&simulation));
        }
    }
    println!("ended");
    Ok(())
}

async fn draw(window: &mut Window, view: &mut View, simulation: &Simulation, controls: &Controls) -> bool {
    let size = [window.width() as f32, window.height() as f32];
    let figures = Figures::of(simulation, controls);
    let sheet = hud::viewer(&figures, &simulation.history, controls, size);
    view.render(window, simulation, controls, &sheet).await
}

/// Returns the actions of the keys that were pressed since the last frame.
fn actions(window: &Window) -> Vec<Action> {
    let mut events = window.events();
    let pressed = events.iter().filter_map(|event| match event.value {
        WindowEvent::Key(key, KeyAction::Press, _) => action_of(key),
        _ => None,
    });
    pressed.collect()
}

/// Saves the last frame under the first free number.
fn save_picture(options: &Options, window: &Window) -> Result<(), Error> {
    let paths = (1..).map(|number: u32| options.pictures.join(format!("viewer-{number:03}.png")));
    let path = paths.into_iter().find(|path| !path.exists()).unwrap_or_default();
    save(&window.snap_image(), &path)?;
    println!("saved {}", path.display());
    Ok(())
}

/// The window library panics without a display, so this says first what is missing.
fn check_display() -> Result<(), Error> {
    let is_set = |name: &str| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    let needs_one = cfg!(all(unix, not(target_os = "macos")));
    if needs_one && !is_set("DISPLAY") && !is_set("WAYLAND_DISPLAY") { Err(Error::NoDisplay) } else { Ok(()) }
}
