//! The viewer's window.

use crate::controls::{Action, Controls, action_of};
use crate::draw::{Quality, View};
use crate::figures::Figures;
use crate::hud;
use crate::options::Options;
use crate::pictures::save;
use crate::simulation::Simulation;
use kiss3d::event::{Action as KeyAction, WindowEvent};
use kiss3d::window::Window;
use std::any::Any;
use std::panic::{self, AssertUnwindSafe};

/// Opens a window and runs the scene in it until the window is closed. Prints the state after each key.
///
/// # Errors
/// If there is no display, or a window cannot be opened on it.
pub async fn run(options: &Options, quality: Quality) -> Result<(), String> {
    let mut window = open(options.size, quality)?;
    let mut simulation = Simulation::new(options.setting(), options.backend);
    let mut controls = Controls::new(options.colour);
    let mut view = View::new(&mut window, &simulation, quality);
    println!("ready {}", controls.describe(&simulation));
    while !controls.is_ending && draw(&mut window, &mut view, &simulation, &controls).await {
        if std::mem::take(&mut controls.is_saving) {
            save_picture(options, &window);
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

/// Saves the last frame under the first free number. An error is printed, because the scene can go on without the picture.
fn save_picture(options: &Options, window: &Window) {
    let paths = (1..).map(|number: u32| options.pictures.join(format!("viewer-{number:03}.png")));
    let path = paths.into_iter().find(|path| !path.exists()).unwrap_or_default();
    match save(&window.snap_image(), &path) {
        Ok(()) => println!("saved {}", path.display()),
        Err(error) => eprintln!("the picture was not saved: {error}"),
    }
}

/// Opens the window. The window library panics if it reaches no display or lacks a library of the display, so the panic becomes
/// an error here.
fn open([width, height]: [u32; 2], quality: Quality) -> Result<Window, String> {
    check_display()?;
    let opening = || Window::new_with_setup("pbig", width, height, quality.canvas_setup());
    let window = without_panic_message(|| kiss3d::pollster::block_on(opening()));
    window.map_err(|panic| no_display(text_of(&*panic)))
}

/// Calls a function, and returns its panic instead of printing it.
fn without_panic_message<T>(call: impl FnOnce() -> T) -> Result<T, Box<dyn Any + Send>> {
    let hook = panic::take_hook();
    panic::set_hook(Box::new(|_| {}));
    let result = panic::catch_unwind(AssertUnwindSafe(call));
    panic::set_hook(hook);
    result
}

/// Returns the text of a panic.
fn text_of(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<String>().map(String::as_str);
    let text = text.or_else(|| panic.downcast_ref::<&str>().copied());
    text.unwrap_or("the window library gave no reason")
}

fn no_display(why: &str) -> String {
    format!("there is no display: {why}\n--frames DIR writes pictures without one")
}

/// Says what is missing, in clearer words than the window library's.
fn check_display() -> Result<(), String> {
    let is_set = |name: &str| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    let needs_one = cfg!(all(unix, not(target_os = "macos")));
    if needs_one && !is_set("DISPLAY") && !is_set("WAYLAND_DISPLAY") {
        return Err(no_display("neither DISPLAY nor WAYLAND_DISPLAY is set"));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_returned_with_its_text() {
        assert_eq!(without_panic_message(|| 7).ok(), Some(7));
        let text = |call: fn()| without_panic_message(call).map_err(|panic| text_of(&*panic).to_owned());
        assert_eq!(text(|| panic!("plain")), Err("plain".into()));
        assert_eq!(text(|| panic!("number {}", std::hint::black_box(3))), Err("number 3".into()));
        assert!(text(|| panic::panic_any(3)).unwrap_err().contains("no reason"));
    }
}
