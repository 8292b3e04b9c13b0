//! The figures on the screen, as text.

use crate::choice::Choice;
use crate::controls::Controls;
use crate::simulation::Simulation;
use pbig_scenes::times::Summary;
use rapier_pbig::PbigBroadPhase;

/// The number of characters after which the plan's text is broken.
const LINE_CHARS: usize = 52;

/// The figures of a simulation at one moment.
#[derive(Clone, Debug, PartialEq)]
pub struct Figures {
    /// The scene, its bodies and its steps.
    pub scene: String,
    /// The broad phase, and its adapter on a GPU.
    pub broad_phase: String,
    /// Times inside the broad phase and of whole steps.
    pub times: Vec<String>,
    /// Pairs and events.
    pub counts: String,
    /// The error of the last update, broken into lines.
    pub error: Vec<String>,
    /// The algorithm and the reasons, broken into lines.
    pub plan: Vec<String>,
    /// The legend of the colours.
    pub legend: &'static str,
}

impl Figures {
    /// Gathers the figures.
    pub fn of(simulation: &Simulation, controls: &Controls) -> Self {
        let pbig = simulation.broad_phase.pbig();
        let broad_phase = simulation.history.summary(|step| step.broad_phase_ms);
        let step = simulation.history.summary(|step| step.step_ms);
        let last = simulation.history.last().map_or([0.0; 2], |step| [step.broad_phase_ms, step.step_ms]);
        Self {
            scene: scene_line(simulation, controls),
            broad_phase: broad_phase_line(simulation.choice, pbig),
            times: vec![
                time_line("broad phase", last[0], broad_phase),
                time_line("whole step", last[1], step),
            ],
            counts: counts_line(simulation.world.pair_count(), simulation.broad_phase.events()),
            error: wrap(&error_text(pbig)),
            plan: wrap(&plan_text(pbig)),
            legend: controls.colouring.legend(),
        }
    }

    /// Returns all lines, top to bottom.
    pub fn lines(&self) -> Vec<&str> {
        let head = [&self.scene, &self.broad_phase].into_iter().chain(&self.times).chain([&self.counts]);
        let all = head.chain(&self.error).chain(&self.plan);
        all.map(String::as_str).chain([self.legend]).collect()
    }
}

fn scene_line(simulation: &Simulation, controls: &Controls) -> String {
    let (name, bodies) = (simulation.setting.scene.name, simulation.world.bodies.len());
    let paused = if controls.is_paused { ", paused" } else { "" };
    format!("{name}: {bodies} bodies, step {}{paused}", simulation.steps)
}

fn broad_phase_line(choice: Choice, pbig: Option<&PbigBroadPhase>) -> String {
    let adapter = pbig.and_then(PbigBroadPhase::device_name).filter(|_| choice == Choice::Gpu);
    adapter.map_or_else(|| choice.name().to_owned(), |adapter| format!("{}: {adapter}", choice.name()))
}

fn time_line(name: &str, last: f64, Summary { mean, p99, .. }: Summary) -> String {
    format!("{name} {last:.2} ms  (mean {mean:.2}, p99 {p99:.2})")
}

fn counts_line(pairs: usize, [added, deleted]: [u64; 2]) -> String {
    format!("{pairs} pairs, events: {added} added, {deleted} removed")
}

fn error_text(pbig: Option<&PbigBroadPhase>) -> String {
    let error = pbig.and_then(PbigBroadPhase::last_error);
    error.map(|error| format!("error: {error}")).unwrap_or_default()
}

/// Returns the algorithm and the reasons: the plan of the last update, and why a GPU was not used.
fn plan_text(pbig: Option<&PbigBroadPhase>) -> String {
    let Some(pbig) = pbig else { return "a tree of boxes, updated and searched in each step".to_owned() };
    let report = pbig.stats().report;
    match &report.fallback {
        Some(why) => format!("{}; {why}", report.plan),
        None => report.plan.to_string(),
    }
}

/// Breaks a text between words; none for an empty one.
fn wrap(text: &str) -> Vec<String> {
    let lines = textwrap::wrap(text, LINE_CHARS).into_iter().map(Into::into);
    lines.filter(|line: &String| !line.is_empty()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::palette::Colouring;
    use crate::simulation::{Setting, with_max_pairs};
    use pbig_scenes::scenes::Scene;

    fn figures(choice: Choice, steps: usize) -> Figures {
        let setting = Setting { scene: Scene::named("column").unwrap(), bodies: 200, seed: 1 };
        let mut simulation = Simulation::new(setting, choice);
        (0..steps).for_each(|_| simulation.step());
        Figures::of(&simulation, &Controls::new(Colouring::Shape))
    }

    #[test]
    fn figures_name_scene_broad_phase_and_algorithm() {
        // In the first step every box is new to the first of its two updates, and few change until the second.
        let pbig = figures(Choice::Cpu, 1);
        assert_eq!(pbig.scene, "column: 200 bodies, step 1");
        assert_eq!(pbig.broad_phase, "pbig on the CPU");
        assert!(
            pbig.counts.contains(" pairs, events: ") && pbig.counts.contains(" added, "),
            "{}",
            pbig.counts
        );
        assert_eq!(pbig.plan, ["look-up: few of 201 boxes have changed"]);
        let stock = figures(Choice::Stock, 3);
        assert!(stock.broad_phase.starts_with("stock") && stock.plan[0].starts_with("a tree"));
        assert!(stock.lines().len() == stock.plan.len() + 6);
    }

    #[test]
    fn an_error_of_the_broad_phase_is_shown() {
        assert!(figures(Choice::Cpu, 1).error.is_empty() && figures(Choice::Stock, 1).error.is_empty());
        let setting = Setting { scene: Scene::named("column").unwrap(), bodies: 200, seed: 1 };
        let mut simulation = Simulation::new(setting, Choice::Auto);
        simulation.broad_phase = with_max_pairs(10);
        simulation.step();
        let figures = Figures::of(&simulation, &Controls::new(Colouring::Shape));
        let shown = figures.lines().join(" ");
        assert!(shown.contains("error: ") && shown.contains("10"), "{shown}");
    }

    #[test]
    fn times_are_those_of_the_steps() {
        let lines = figures(Choice::Cpu, 5).times;
        assert!(
            lines[0].starts_with("broad phase ") && !lines[0].contains("mean 0.00, p99 0.00"),
            "{lines:?}"
        );
        let none = figures(Choice::Cpu, 0).times;
        assert_eq!(none[1], "whole step 0.00 ms  (mean 0.00, p99 0.00)");
    }
}
