//! The layout of figures, keys and graph on the screen.

use crate::choice::Choice;
use crate::controls::{BINDINGS, Controls};
use crate::figures::Figures;
use crate::graph::{self, colour_of, scale_end_ms};
use crate::history::History;
use crate::sheet::{Area, Rgba, Sheet};

/// Texts.
const INK: Rgba = [0.13, 0.16, 0.20, 1.0];
/// The colour behind texts.
const PAPER: Rgba = [1.0, 1.0, 1.0, 0.82];
/// The height of a text line, as a share of the picture's height.
const TEXT_SHARE: f32 = 0.026;
/// The smallest readable height of a text line, in pixels.
const MIN_TEXT_PIXELS: f32 = 15.0;
/// The width that the graph and the keys need beside each other, in text lines.
const WIDTH_IN_LINES: f32 = 48.0;
/// The mean width of a character, as a share of its line's height.
const CHAR_WIDTH: f32 = 0.44;

/// Lays out the viewer's figures at the left, the keys at the right and the graph below. `size` is the picture's, in pixels.
pub fn viewer(figures: &Figures, history: &History, controls: &Controls, size: [f32; 2]) -> Sheet {
    let mut sheet = Sheet::default();
    let text = (TEXT_SHARE * size[1]).min(size[0] / WIDTH_IN_LINES).max(MIN_TEXT_PIXELS);
    let choice = history.last().map(|step| step.choice);
    add_figures(&mut sheet, figures, choice, text);
    add_graph(&mut sheet, history, size, text);
    if controls.is_help_shown {
        add_keys(&mut sheet, size, text);
    }
    sheet
}

fn add_figures(sheet: &mut Sheet, figures: &Figures, choice: Option<Choice>, text: f32) {
    let lines = figures.lines();
    let longest = lines.iter().map(|line| line.chars().count()).max().unwrap_or(0);
    let (width, height) =
        ((longest as f32 * CHAR_WIDTH + 1.0) * text, (lines.len() as f32 * 1.2 + 0.8) * text);
    sheet.panel(Area { x: 0.5 * text, y: 0.5 * text, width, height }, PAPER);
    for (i, line) in lines.into_iter().enumerate() {
        let is_name = line == figures.broad_phase;
        let colour = choice.filter(|_| is_name).map_or(INK, colour_of);
        sheet.text(line, [text, (0.9 + 1.2 * i as f32) * text], text, colour);
    }
}

fn add_graph(sheet: &mut Sheet, history: &History, size: [f32; 2], text: f32) {
    let (width, height) = (24.0 * text, 8.0 * text);
    let area = Area { x: 0.5 * text, y: size[1] - height - 0.5 * text, width, height };
    sheet.panel(area, PAPER);
    sheet.text("broad phase, ms a step", [area.x + 0.5 * text, area.y + 0.2 * text], text, INK);
    let inner =
        Area { x: area.x + 0.5 * text, y: area.y + 1.5 * text, width: 23.0 * text, height: 6.0 * text };
    graph::draw(sheet, inner, history, scale_end_ms(history.longest_broad_phase_ms()), text);
}

fn add_keys(sheet: &mut Sheet, size: [f32; 2], text: f32) {
    let (width, height) = (23.0 * text, (BINDINGS.len() as f32 * 1.15 + 1.0) * text);
    let area = Area { x: size[0] - width - 0.5 * text, y: size[1] - height - 0.5 * text, width, height };
    sheet.panel(area, PAPER);
    for (i, binding) in BINDINGS.iter().enumerate() {
        let y = area.y + (0.45 + 1.15 * i as f32) * text;
        sheet.text(binding.name, [area.x + 0.5 * text, y], 0.95 * text, INK);
        sheet.text(binding.help, [area.x + 3.6 * text, y], 0.95 * text, INK);
    }
}

/// One side of a comparison.
pub struct HudSide<'a> {
    pub choice: Choice,
    pub history: &'a History,
    /// Where the graph's axis ends, in ms: the same on both sides.
    pub end_ms: f64,
    /// The title of the graph.
    pub title: String,
}

/// The height of a comparison's text line, as a share of the picture's height: ten pixels where a phone shows the picture.
const COMPARISON_TEXT_SHARE: f32 = 0.054;

/// Lays out one half of a comparison: the broad phase's name, its median time, and the graph.
/// `size` is the half's, in pixels.
pub fn comparison(side: &HudSide<'_>, size: [f32; 2]) -> Sheet {
    let mut sheet = Sheet::default();
    let text = COMPARISON_TEXT_SHARE * size[1];
    add_times(&mut sheet, side, size[0], text);
    let graph = Area { x: 0.0, y: size[1] - 4.6 * text, width: size[0], height: 4.6 * text };
    sheet.panel(graph, PAPER);
    sheet.text(side.title.as_str(), [0.5 * text, graph.y + 0.1 * text], 0.85 * text, INK);
    let inner = Area { x: 0.5 * text, y: graph.y + 1.2 * text, width: size[0] - text, height: 3.2 * text };
    graph::draw(&mut sheet, inner, side.history, side.end_ms, 0.9 * text);
    sheet
}

fn add_times(sheet: &mut Sheet, side: &HudSide<'_>, width: f32, text: f32) {
    let colour = colour_of(side.choice);
    let name = if side.choice == Choice::Stock { "rapier's own broad phase" } else { "pbig" };
    sheet.panel(Area { x: 0.0, y: 0.0, width, height: 3.3 * text }, PAPER);
    sheet.text(name, [0.5 * text, 0.15 * text], 1.2 * text, colour);
    // A median, because another program that takes the processor for a while changes a mean.
    let median = format!("{:.2} ms", side.history.summary(|step| step.broad_phase_ms).median);
    let large = 1.7 * text;
    let behind = (median.chars().count() as f32 * 0.54) * large + 0.8 * text;
    sheet.text(median, [0.5 * text, 1.4 * text], large, colour);
    sheet.text("broad phase, median", [behind, 2.1 * text], 0.95 * text, INK);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::history::MeasuredStep;
    use crate::options::MIN_SIZE;
    use crate::palette::Colouring;
    use crate::simulation::{Setting, Simulation};
    use pbig_scenes::scenes::Scene;

    fn overlaps(a: Area, b: Area) -> bool {
        a.x < b.x + b.width && b.x < a.x + a.width && a.y < b.y + b.height && b.y < a.y + a.height
    }

    fn has_overlap(sheet: &Sheet) -> bool {
        let areas: Vec<Area> = sheet.panels.iter().map(|panel| panel.area).collect();
        (1..areas.len()).any(|i| areas[..i].iter().any(|&area| overlaps(area, areas[i])))
    }

    fn is_inside(sheet: &Sheet, size: [f32; 2]) -> bool {
        let is_area_inside = |area: &Area| {
            area.x >= 0.0
                && area.y >= 0.0
                && area.x + area.width <= size[0]
                && area.y + area.height <= size[1]
        };
        sheet.panels.iter().all(|panel| is_area_inside(&panel.area))
            && sheet.texts.iter().all(|text| text.at[0] >= 0.0 && text.at[1] + text.size <= size[1] + 1.0)
    }

    fn sheet(controls: &Controls, size: [f32; 2]) -> Sheet {
        let setting = Setting { scene: Scene::named("column").unwrap(), bodies: 100, seed: 1 };
        let mut simulation = Simulation::new(setting, Choice::Auto);
        (0..3).for_each(|_| simulation.step());
        viewer(&Figures::of(&simulation, controls), &simulation.history, controls, size)
    }

    #[test]
    fn every_key_is_on_the_screen_unless_hidden() {
        let is_listed = |sheet: &Sheet, text: &str| sheet.texts.iter().any(|found| found.text == text);
        let shown = sheet(&Controls::new(Colouring::Shape), [1280.0, 800.0]);
        let hidden =
            sheet(&Controls { is_help_shown: false, ..Controls::new(Colouring::Shape) }, [1280.0, 800.0]);
        for binding in &BINDINGS {
            assert!(is_listed(&shown, binding.help) && !is_listed(&hidden, binding.help), "{}", binding.name);
        }
    }

    #[test]
    fn nothing_leaves_the_screen() {
        let controls = Controls::new(Colouring::Contacts);
        let min = MIN_SIZE.map(|pixels| pixels as f32);
        for size in [[1280.0, 800.0], [800.0, 600.0], [3840.0, 2160.0], [min[0], 2160.0], min] {
            let sheet = sheet(&controls, size);
            assert!(sheet.panels.len() == 3 && is_inside(&sheet, size), "{size:?}");
            assert!(!has_overlap(&sheet), "{size:?}");
        }
        assert!(!is_inside(&sheet(&controls, [300.0, 200.0]), [300.0, 200.0]), "too small for it");
        assert!(has_overlap(&sheet(&controls, [min[0] - 40.0, min[1]])), "graph and keys meet");
    }

    #[test]
    fn a_comparison_shows_the_median_of_its_side() {
        let mut history = History::default();
        for broad_phase_ms in [1.0, 1.5, 9.0] {
            history.push(MeasuredStep { choice: Choice::Stock, swaps: 0, broad_phase_ms, step_ms: 9.0 });
        }
        let side = HudSide { choice: Choice::Stock, history: &history, end_ms: 10.0, title: "step 2".into() };
        let sheet = comparison(&side, [640.0, 640.0]);
        let has = |text: &str| sheet.texts.iter().any(|found| found.text == text);
        assert!(has("1.50 ms") && has("rapier's own broad phase") && has("step 2"));
        assert!(is_inside(&sheet, [640.0, 640.0]));
    }
}
