//! Draws a sheet over the picture.

use super::linear;
use crate::sheet::{Panel, Rgba, Sheet};
use kiss3d::prelude::{Color, Font, SceneNode2d, Vec2, Window};
use std::sync::Arc;

/// The nodes of the panels, and the font.
pub(super) struct Overlay {
    pub(super) root: SceneNode2d,
    panels: Vec<SceneNode2d>,
    font: Arc<Font>,
}

impl Overlay {
    pub(super) fn new() -> Self {
        Self { root: SceneNode2d::empty(), panels: Vec::new(), font: Font::default() }
    }

    /// Prepares a sheet for the next frame.
    pub(super) fn show(&mut self, window: &mut Window, sheet: &Sheet) {
        while self.panels.len() < sheet.panels.len() {
            self.panels.push(self.root.add_rectangle(1.0, 1.0));
        }
        for (i, node) in self.panels.iter_mut().enumerate() {
            show_panel(node, sheet.panels.get(i));
        }
        for line in &sheet.lines {
            let [from, to] = line.ends.map(Vec2::from_array);
            window.draw_line_2d(from, to, encoded(line.colour), line.width);
        }
        for text in &sheet.texts {
            let at = Vec2::from_array(text.at);
            let [red, green, blue, alpha] = text.colour;
            window.draw_text(&text.text, at, text.size, &self.font, Color::new(red, green, blue, alpha));
        }
    }
}

fn show_panel(node: &mut SceneNode2d, panel: Option<&Panel>) {
    node.set_visible(panel.is_some());
    let Some(Panel { area, colour: rgba }) = panel else { return };
    node.set_local_scale(area.width, area.height);
    node.set_position(Vec2::new(area.x + 0.5 * area.width, area.y + 0.5 * area.height));
    node.set_color(encoded(*rgba));
}

fn encoded([red, green, blue, alpha]: Rgba) -> Color {
    linear([red, green, blue], alpha)
}
