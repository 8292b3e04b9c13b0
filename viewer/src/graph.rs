//! The rolling graph of the broad phase's time.

use crate::choice::Choice;
use crate::history::{HISTORY_STEPS, History, MeasuredStep};
use crate::sheet::{Area, Rgba, Sheet};

/// The graph's lines and texts.
const INK: Rgba = [0.13, 0.16, 0.20, 1.0];
/// The lines of the scale.
const FAINT: Rgba = [0.13, 0.16, 0.20, 0.22];

/// Returns the colour of a broad phase: that of the charts (`pbig-chart`, whose test compares) and of the page.
pub fn colour_of(choice: Choice) -> Rgba {
    rgba(match choice {
        Choice::Stock => 0xd94724,
        Choice::Auto | Choice::Cpu => 0x0a8075,
        Choice::Gpu => 0x6b42cc,
    })
}

fn rgba(hex: u32) -> Rgba {
    let [_, r, g, b] = hex.to_be_bytes().map(|part| f32::from(part) / 255.0);
    [r, g, b, 1.0]
}

/// Returns the upper end of a scale for times up to this one, in ms: 1, 2 or 5 times a power of ten.
pub fn scale_end_ms(longest_ms: f64) -> f64 {
    let longest = longest_ms.max(1e-3);
    let power = 10f64.powf(longest.log10().floor());
    [1.0, 2.0, 5.0].map(|step| step * power).into_iter().find(|&end| end >= longest).unwrap_or(10.0 * power)
}

/// Adds a graph of the broad phase's time to a sheet: one line for each broad phase that was in use, in its colour, and a
/// dashed line at the p99 of the one in use now. The axis ends at `end_ms`, at the upper border. `size` is the height of texts.
pub fn draw(sheet: &mut Sheet, area: Area, history: &History, end_ms: f64, size: f32) {
    let points: Vec<[f32; 2]> = places(history, area, end_ms);
    let steps: Vec<&MeasuredStep> = history.steps().collect();
    let mut start = 0;
    for run in steps.chunk_by(|a, b| a.swaps == b.swaps) {
        // A run begins where the one before it ends, so that the graph has no gap.
        let from = start.max(1) - 1;
        sheet.path(&points[from..start + run.len()], 0.1 * size, colour_of(run[0].choice));
        start += run.len();
    }
    sheet.path(&[area.at(0.0, 0.0), area.at(1.0, 0.0)], 1.0, FAINT);
    sheet.path(&[area.at(0.0, 1.0), area.at(1.0, 1.0)], 1.0, FAINT);
    sheet.text(format!("{end_ms} ms"), area.at(0.0, 1.0), 0.8 * size, INK);
    draw_p99(sheet, area, history, end_ms, size);
}

/// Returns the point of each step. The newest one lies at the right border once the history is full.
fn places(history: &History, area: Area, end_ms: f64) -> Vec<[f32; 2]> {
    let place = |(i, step): (usize, &MeasuredStep)| {
        let share = (step.broad_phase_ms / end_ms).min(1.0) as f32;
        area.at(i as f32 / (HISTORY_STEPS - 1) as f32, share)
    };
    history.steps().enumerate().map(place).collect()
}

fn draw_p99(sheet: &mut Sheet, area: Area, history: &History, end_ms: f64, size: f32) {
    let Some(last) = history.last() else { return };
    let p99 = history.summary(|step| step.broad_phase_ms).p99;
    let (share, colour) = ((p99 / end_ms).min(1.0) as f32, colour_of(last.choice));
    let dashes = 40;
    for dash in (0..dashes).step_by(2) {
        let [from, to] = [dash, dash + 1].map(|i| area.at(i as f32 / dashes as f32, share));
        sheet.path(&[from, to], 1.5, colour);
    }
    let [x, y] = area.at(1.0, share);
    // Below the line where there is no room above it.
    let y = if share > 0.8 { y + 0.1 * size } else { y - 0.9 * size };
    sheet.text(format!("p99 {p99:.2} ms"), [x - 5.4 * size, y], 0.85 * size, colour);
}

#[cfg(test)]
mod tests {
    use super::*;

    const AREA: Area = Area { x: 10.0, y: 20.0, width: 299.0, height: 100.0 };

    fn history(times: &[(Choice, f64)]) -> History {
        let mut history = History::default();
        for &(choice, broad_phase_ms) in times {
            if history.last().is_some_and(|last| last.choice != choice) {
                history.count_swap();
            }
            let swaps = history.swaps();
            history.push(MeasuredStep { choice, swaps, broad_phase_ms, step_ms: 1.0 });
        }
        history
    }

    #[test]
    fn scales_end_at_round_times() {
        let ends = [0.0, 0.011, 0.9, 1.0, 1.1, 4.0, 7.0, 80.0].map(scale_end_ms);
        assert_eq!(ends, [0.001, 0.02, 1.0, 1.0, 2.0, 5.0, 10.0, 100.0]);
    }

    #[test]
    fn a_step_is_one_pixel_wide_and_its_time_high() {
        let points =
            places(&history(&[(Choice::Cpu, 0.0), (Choice::Cpu, 1.0), (Choice::Cpu, 9.0)]), AREA, 2.0);
        assert_eq!(points, [[10.0, 120.0], [11.0, 70.0], [12.0, 20.0]]);
    }

    #[test]
    fn each_broad_phase_has_its_colour_and_the_line_has_no_gap() {
        let mut sheet = Sheet::default();
        let times = [(Choice::Stock, 1.0), (Choice::Stock, 2.0), (Choice::Cpu, 1.0), (Choice::Gpu, 1.5)];
        draw(&mut sheet, AREA, &history(&times), 2.0, 10.0);
        let path: Vec<_> = sheet.lines.iter().take(3).collect();
        assert!(path.windows(2).all(|two| two[0].ends[1] == two[1].ends[0]));
        let colours: Vec<_> = path.iter().map(|line| line.colour).collect();
        assert_eq!(colours, [Choice::Stock, Choice::Cpu, Choice::Gpu].map(colour_of));
        assert!(
            sheet
                .texts
                .iter()
                .any(|text| text.text == "p99 1.50 ms" && text.colour == colour_of(Choice::Gpu))
        );
    }

    #[test]
    fn without_steps_there_is_a_scale_alone() {
        let mut sheet = Sheet::default();
        draw(&mut sheet, AREA, &History::default(), 2.0, 10.0);
        assert_eq!((sheet.lines.len(), sheet.texts.len()), (2, 1));
    }
}
