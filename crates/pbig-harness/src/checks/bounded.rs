//! The work of searches and updates is bounded for every recipe of a world.

use super::input::Input;
use crate::hard::{Change, History, Part, Placement, Recipe, ratio_of_history, ratio_of_search};
use pbig_core::WORK_LIMIT;

/// A byte for the number of boxes, one for the updates, then parts of 12 bytes: one to four of a world, and one to four of
/// the world that its boxes move to.
pub fn work_is_bounded(data: &[u8]) {
    let mut input = Input(data);
    let (Some(boxes), Some(updates)) = (input.byte(), input.byte()) else { return };
    let (n, updates) = (65 + 8 * usize::from(boxes), 1 + usize::from(updates % 64));
    let Some(start) = recipe(&mut input) else { return };
    check(ratio_of_search(&start, n), &start);
    if let Some(to) = recipe(&mut input) {
        let history = History { start, change: Change::To(to), updates };
        check(ratio_of_history(&history, n), &history);
    }
}

fn check(ratio: Option<f64>, what: &dyn std::fmt::Debug) {
    let ratio = ratio.unwrap_or(0.0);
    assert!(ratio <= WORK_LIMIT as f64, "{ratio}: {what:?}");
}

fn recipe(input: &mut Input) -> Option<Recipe> {
    let parts = 1 + input.byte()? % 4;
    let parts: Vec<Part> = (0..parts).map_while(|_| part(input)).collect();
    (!parts.is_empty()).then_some(Recipe(parts))
}

fn part(input: &mut Input) -> Option<Part> {
    let kind = input.byte()?;
    let place =
        [Placement::Anywhere, Placement::Line, Placement::Lattice, Placement::Around][usize::from(kind & 3)];
    let mut three = || Some([number(input.byte()?), number(input.byte()?), number(input.byte()?)]);
    let (corner, width, half) = (three()?, three()?, three()?);
    let [weight, decades] = [input.byte()?, input.byte()?];
    let decades = f32::from(decades) / 64.0;
    Some(Part { weight: 1 + u32::from(weight % 20), place, corner, width, growth: 0.0, half, decades })
}

/// Returns 0, or a number from 10^-8 to 10^8.
fn number(byte: u8) -> f32 {
    if byte == 0 { 0.0 } else { 10f32.powf((f32::from(byte) - 128.0) / 16.0) }
}
