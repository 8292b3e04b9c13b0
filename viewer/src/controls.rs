//! Keys and their actions.

use crate::choice::Choice;
use crate::palette::Colouring;
use crate::simulation::{Ball, Simulation};
use kiss3d::event::Key;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    Pause,
    Step,
    Reset,
    NextScene,
    NextBroadPhase,
    Use(Choice),
    ThrowBall,
    NextColouring,
    ToggleHelp,
    SavePicture,
    Quit,
}

pub struct Binding {
    pub key: Key,
    pub name: &'static str,
    pub action: Action,
    pub help: &'static str,
}

const fn bind(key: Key, name: &'static str, action: Action, help: &'static str) -> Binding {
    Binding { key, name, action, help }
}

pub const BINDINGS: [Binding; 13] = [
    bind(Key::Space, "Space", Action::Pause, "pause or go on"),
    bind(Key::S, "S", Action::Step, "one step, then pause"),
    bind(Key::R, "R", Action::Reset, "build the scene again"),
    bind(Key::N, "N", Action::NextScene, "next scene"),
    bind(Key::B, "B", Action::NextBroadPhase, "next broad phase: stock, CPU, GPU"),
    bind(Key::Key1, "1", Action::Use(Choice::Stock), "stock"),
    bind(Key::Key2, "2", Action::Use(Choice::Cpu), "pbig on the CPU"),
    bind(Key::Key3, "3", Action::Use(Choice::Gpu), "pbig on the GPU"),
    bind(Key::T, "T", Action::ThrowBall, "throw a ball to where you look"),
    bind(Key::C, "C", Action::NextColouring, "colour by shape, contacts, sleeping"),
    bind(Key::H, "H", Action::ToggleHelp, "hide these keys"),
    bind(Key::P, "P", Action::SavePicture, "save a picture"),
    bind(Key::Escape, "Esc", Action::Quit, "quit"),
];

pub fn action_of(key: Key) -> Option<Action> {
    BINDINGS.iter().find(|binding| binding.key == key).map(|binding| binding.action)
}

/// Switches: parts of the picture, and whether the scene runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Controls {
    pub is_paused: bool,
    pub colouring: Colouring,
    pub is_help_shown: bool,
    pub is_ending: bool,
    pub is_saving: bool,
}

impl Controls {
    /// Returns the controls of a scene that runs, with its keys listed.
    pub fn new(colouring: Colouring) -> Self {
        Self { is_paused: false, colouring, is_help_shown: true, is_ending: false, is_saving: false }
    }

    /// Does what a key asks for. `ball` is thrown if the key asks for one.
    pub fn obey(&mut self, action: Action, simulation: &mut Simulation, ball: Ball) {
        match action {
            Action::Pause => self.is_paused = !self.is_paused,
            Action::Step => {
                self.is_paused = true;
                simulation.step();
            }
            Action::Reset => simulation.reset(),
            Action::NextScene => simulation.next_scene(),
            Action::NextBroadPhase => simulation.swap(simulation.choice.next()),
            Action::Use(choice) => simulation.swap(choice),
            Action::ThrowBall => simulation.throw(ball),
            Action::NextColouring => self.colouring = self.colouring.next(),
            Action::ToggleHelp => self.is_help_shown = !self.is_help_shown,
            Action::SavePicture => self.is_saving = true,
            Action::Quit => self.is_ending = true,
        }
    }

    /// Describes the state in one line, which the program prints after each key.
    pub fn describe(&self, simulation: &Simulation) -> String {
        let Self { is_paused, colouring, is_help_shown, .. } = self;
        let scene = simulation.setting.scene.name;
        let (backend, steps) = (simulation.choice, simulation.steps);
        let (bodies, pairs) = (simulation.world.bodies.len(), simulation.world.pair_count());
        format!(
            "scene={scene} bodies={bodies} step={steps} paused={is_paused} backend={backend:?} pairs={pairs} \
             colouring={colouring:?} help={is_help_shown}"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulation::Setting;
    use pbig_scenes::scenes::Scene;

    const BALL: Ball = Ball { from: [0.0, 90.0, 0.0], velocity: [0.0; 3], radius: 1.0 };

    fn start() -> (Controls, Simulation) {
        let setting = Setting { scene: Scene::named("column").unwrap(), bodies: 50, seed: 1 };
        (Controls::new(Colouring::Shape), Simulation::new(setting, Choice::Cpu))
    }

    #[test]
    fn each_key_has_one_action_and_each_action_changes_the_state() {
        for (i, binding) in BINDINGS.iter().enumerate() {
            assert!(BINDINGS[..i].iter().all(|other| other.key != binding.key), "{}", binding.name);
            let (mut controls, mut simulation) = start();
            simulation.step();
            let before = (controls, controls.describe(&simulation));
            controls.obey(action_of(binding.key).unwrap(), &mut simulation, BALL);
            let is_same = before == (controls, controls.describe(&simulation));
            assert_eq!(is_same, binding.action == Action::Use(Choice::Cpu), "{}", binding.name);
        }
        assert_eq!(action_of(Key::F12), None);
    }
}
