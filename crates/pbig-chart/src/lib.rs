//! Charts as SVG: panels of lines or points over linear or logarithmic axes, with a legend below each.

mod colour;

use plotters::coord::Shift;
use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use std::path::Path;

/// Maximum number of lines in a panel: more cannot be told apart.
pub const MAX_LINES: usize = 6;

/// Width of a chart and height of a plot, in pixels. On a phone's screen a chart is about 0.6 times as wide, and its text still 12 pixels high.
const WIDTH: u32 = 600;
const PLOT: u32 = 440;

/// Height of the title and the label of the y axis above a plot, in pixels.
const HEAD: u32 = 62;

/// Height of text and of titles, which the drawing backend divides by 1.24: 20 and 21 pixels.
const TEXT: u32 = 25;
const TITLE: u32 = 26;

/// Maximum number of characters in a line of the legend, and the height of such a line in pixels.
const LEGEND_LETTERS: usize = 50;
const LEGEND_LINE: u32 = 25;

/// Times are drawn on a logarithmic axis if the longest is more than this many times the median of some line.
const LINEAR_SPAN: f64 = 20.0;

/// A named line of a panel.
#[derive(Clone, Debug)]
pub struct Line {
    /// The name in the legend.
    pub name: String,
    /// The points, in the order in which they are joined. On logarithmic axes a y of 0 has a line of its own at the bottom;
    /// other points that have no logarithm are left out.
    pub points: Vec<(f64, f64)>,
}

impl Line {
    /// Returns a line of a value for each step.
    pub fn steps(name: &str, values: impl IntoIterator<Item = f64>) -> Self {
        let points = values.into_iter().enumerate().map(|(step, value)| (step as f64, value));
        Self { name: name.into(), points: points.collect() }
    }
}

/// One plot.
#[derive(Clone, Debug)]
pub struct Plot {
    /// The title above the plot.
    pub title: String,
    /// Label of the x axis, with its unit.
    pub x: String,
    /// Label of the y axis, with its unit.
    pub y: String,
    /// True if both axes are logarithmic; then points have marks.
    pub is_log: bool,
    /// True if the y axis is logarithmic, at least.
    pub is_log_y: bool,
    /// The lines, at most [`MAX_LINES`].
    pub lines: Vec<Line>,
}

/// A chart for a file.
#[derive(Clone, Debug, Default)]
pub struct Chart {
    /// The file's name without its extension.
    pub name: String,
    /// The plots, one below the other.
    pub plots: Vec<Plot>,
}

impl Chart {
    /// Returns a chart of one plot with marks over logarithmic axes. Lines without points are left out.
    pub fn log(name: &str, title: &str, [x, y]: [&str; 2], mut lines: Vec<Line>) -> Self {
        lines.retain(|line| !line.points.is_empty());
        let (title, x, y) = (title.into(), x.into(), y.into());
        Self { name: name.into(), plots: vec![Plot { title, x, y, is_log: true, is_log_y: true, lines }] }
    }

    /// Writes the chart. An error names the file.
    pub fn write(&self, path: &Path) -> Result<(), String> {
        self.draw(path).map_err(|error| format!("{}: cannot write the chart: {error}", path.display()))
    }

    fn draw(&self, path: &Path) -> Done {
        let heights: Vec<u32> = self.plots.iter().map(|plot| PLOT + plot.legend_height()).collect();
        let root = SVGBackend::new(path, (WIDTH, heights.iter().sum::<u32>().max(PLOT))).into_drawing_area();
        root.fill(&WHITE)?;
        let mut rest = root.clone();
        for (plot, height) in self.plots.iter().zip(heights) {
            let (area, below) = rest.split_vertically(height);
            let (area, legend) = area.split_vertically(PLOT);
            plot.draw(&area)?;
            plot.draw_legend(&legend)?;
            rest = below;
        }
        root.present()?;
        Ok(())
    }
}

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Done = Result<(), Box<dyn std::error::Error>>;

impl Plot {
    /// Returns milliseconds against steps.
    pub fn steps(title: &str, lines: Vec<Line>) -> Self {
        let (x, y) = ("step".into(), "time, ms".into());
        let is_log_y = spans_much(&lines);
        Self { title: title.into(), x, y, is_log: false, is_log_y, lines }
    }

    fn lines(&self) -> impl Iterator<Item = (&Line, RGBColor)> {
        self.lines.iter().zip(colour::colours(self.lines.iter().map(|line| line.name.as_str())))
    }

    /// Returns the lines of text in the legend, each with its colour if it is the first of a name.
    fn legend(&self) -> Vec<(Option<RGBColor>, String)> {
        let texts = |(line, colour): (&Line, RGBColor)| {
            let texts = textwrap::wrap(&line.name, LEGEND_LETTERS).into_iter().map(String::from);
            texts.enumerate().map(|(i, text)| ((i == 0).then_some(colour), text)).collect::<Vec<_>>()
        };
        self.lines().flat_map(texts).collect()
    }

    fn legend_height(&self) -> u32 {
        self.legend().len() as u32 * LEGEND_LINE + LEGEND_LINE
    }

    fn points(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        self.lines().flat_map(|(line, _)| &line.points).copied().filter(|point| self.has_place(point))
    }

    fn has_place(&self, &(x, y): &(f64, f64)) -> bool {
        x.is_finite() && y.is_finite() && (!self.is_log || x > 0.0) && (!self.is_log_y || y >= 0.0)
    }

    fn axes(&self) -> [Axis; 2] {
        let [x, y] = [self.points().map(|p| p.0).collect(), self.points().map(|p| p.1).collect()];
        [Axis::new(x, self.is_log), Axis::new(y, self.is_log_y)]
    }

    fn draw(&self, area: &Area<'_>) -> Done {
        let [x, y] = self.axes();
        let (head, area) = area.split_vertically(HEAD);
        head.draw(&Text::new(self.title.as_str(), (12, 10), ("sans-serif", TITLE).into_font()))?;
        // Above the axis there is room for a long label, beside it there is none.
        let scale = if self.is_log_y { ", logarithmic" } else { "" };
        head.draw(&Text::new(format!("{}{scale}", self.y), (12, 40), ("sans-serif", TEXT).into_font()))?;
        let mut chart = ChartBuilder::on(&area)
            .margin(12)
            .x_label_area_size(60)
            .y_label_area_size(70)
            .build_cartesian_2d(x.clone(), y.clone())?;
        let mut mesh = chart.configure_mesh();
        mesh.x_desc(&self.x).x_labels(8).y_labels(8).light_line_style(WHITE);
        mesh.axis_desc_style(("sans-serif", TEXT)).label_style(("sans-serif", TEXT)).draw()?;
        for (line, colour) in self.lines() {
            let place = |&(x, v): &(f64, f64)| (x, v.max(y.zero.unwrap_or(f64::MIN)));
            let points: Vec<_> =
                line.points.iter().filter(|point| self.has_place(point)).map(place).collect();
            chart.draw_series(LineSeries::new(points.clone(), colour.stroke_width(2)))?;
            if self.is_log {
                let mark = |at| Circle::new(at, 4, colour.filled());
                chart.draw_series(points.into_iter().map(mark))?;
            }
        }
        Ok(())
    }

    fn draw_legend(&self, area: &Area<'_>) -> Done {
        for (i, (colour, text)) in self.legend().into_iter().enumerate() {
            let y = i as i32 * LEGEND_LINE as i32;
            if let Some(colour) = colour {
                area.draw(&Rectangle::new([(60, y + 6), (80, y + 16)], colour.filled()))?;
            }
            area.draw(&Text::new(text, (90, y + 2), ("sans-serif", TEXT).into_font()))?;
        }
        Ok(())
    }
}

/// Returns true if the longest time would flatten some line on a linear axis.
fn spans_much(lines: &[Line]) -> bool {
    let median = |line: &Line| {
        let mut positive: Vec<f64> = line.points.iter().map(|p| p.1).filter(|y| *y > 0.0).collect();
        positive.sort_by(f64::total_cmp);
        positive.get(positive.len() / 2).copied()
    };
    let shortest = lines.iter().filter_map(median).fold(f64::MAX, f64::min);
    let longest = lines.iter().flat_map(|line| &line.points).map(|p| p.1).fold(0.0, f64::max);
    longest > LINEAR_SPAN * shortest
}

/// One axis.
#[derive(Clone, Debug)]
struct Axis {
    is_log: bool,
    low: f64,
    high: f64,
    /// On a logarithmic axis, the place of the value 0.
    zero: Option<f64>,
}

impl Axis {
    fn new(values: Vec<f64>, is_log: bool) -> Self {
        let low = values.iter().copied().filter(|v| !is_log || *v > 0.0).fold(f64::MAX, f64::min);
        let high = values.iter().copied().fold(f64::MIN, f64::max);
        let (low, high) = if low > high { (1.0, 10.0) } else { (low, high) };
        if !is_log {
            return Self { is_log, low: low.min(0.0), high: high.max(1e-9) * 1.05, zero: None };
        }
        let zero = values.contains(&0.0).then(|| 10f64.powf(low.log10().floor() - 1.0));
        Self { is_log, low: zero.map_or(low / 1.3, |zero| zero / 2.0), high: high * 1.3, zero }
    }

    /// Returns the labelled values of a logarithmic axis: powers of ten, or 1, 2 and 5 times these.
    fn powers(&self, most: usize) -> Vec<f64> {
        let decades = self.low.log10().floor() as i32..=self.high.log10().ceil() as i32;
        let factors: &[f64] = if decades.clone().count() > 4 { &[1.0] } else { &[1.0, 2.0, 5.0] };
        let every = (decades.clone().count() * factors.len()).div_ceil(most.max(2));
        let first = self.zero.map_or(self.low, |zero| zero * 1.5);
        let all = decades.step_by(if factors.len() == 1 { every } else { 1 });
        let all = all.flat_map(|power| factors.iter().map(move |factor| factor * 10f64.powi(power)));
        self.zero.into_iter().chain(all.filter(|v| (first..=self.high).contains(v))).collect()
    }
}

impl Ranged for Axis {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limits: (i32, i32)) -> i32 {
        let scaled = |value: f64| if self.is_log { value.ln() } else { value };
        RangedCoordf64::from(scaled(self.low)..scaled(self.high)).map(&scaled(*value), limits)
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        let most = hint.max_num_points().min(12);
        if self.is_log { self.powers(most) } else { RangedCoordf64::from(self.range()).key_points(most) }
    }

    fn range(&self) -> std::ops::Range<f64> {
        self.low..self.high
    }
}

impl ValueFormatter<f64> for Axis {
    fn format_ext(&self, value: &f64) -> String {
        let rounded = (value * 1e12).round() / 1e12;
        match value.abs() {
            _ if self.zero.is_some_and(|zero| *value < 1.01 * zero) => "0".into(),
            small if self.is_log && !(1e-3..1e5).contains(&small) => format!("{value:e}"),
            _ => format!("{rounded}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawn(points: &[(f64, f64)]) -> String {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("chart.svg");
        let line = Line { name: "a line with a name that is longer".into(), points: points.to_vec() };
        Chart::log("chart", "time and error", ["time, ns", "wrong, %"], vec![line])
            .write(&path)
            .expect("written");
        std::fs::read_to_string(&path).expect("text")
    }

    #[test]
    fn negative_points_are_left_out_and_zero_has_a_place() {
        let points =
            [(1.0, 0.0), (2.0, 3e-4), (3.0, 50.0), (0.0, 1.0), (f64::NAN, 1.0), (1.0, f64::INFINITY)];
        let text = drawn(&points);
        assert_eq!(text.matches("<circle").count(), 3);
        for word in
            ["time and error", "time, ns", "wrong, %", "a line with a name that is", "fill=\"#FFFFFF\""]
        {
            assert!(text.contains(word), "{word} is not in:\n{text}");
        }
        let axis = Axis::new(vec![0.0, 3e-4, 50.0], true);
        assert_eq!(axis.format_ext(&axis.zero.expect("a zero")), "0");
        assert!(axis.zero.is_some_and(|zero| zero < 1e-4 && zero > axis.low));
        assert!(drawn(&[]).contains("time, ns"));
    }

    #[test]
    fn times_far_apart_have_a_logarithmic_axis() {
        let plot = |other: f64| {
            let lines = vec![Line::steps("pbig", [5.0, 0.0, 5.0]), Line::steps("parry 0.31", [9.0, other])];
            Plot::steps("", lines)
        };
        assert!(plot(101.0).is_log_y && !plot(99.0).is_log_y && !plot(101.0).is_log);
        assert!(!Plot::steps("", vec![]).is_log_y);
        let [steps, times] = plot(101.0).axes();
        assert!((steps.low, steps.zero) == (0.0, None) && times.zero.is_some());
    }

    #[test]
    fn axes_have_round_labels() {
        assert_eq!(Axis::new(vec![0.0, 9.0], false).key_points(5), [0.0, 2.0, 4.0, 6.0, 8.0]);
        assert_eq!(Axis::new(vec![1.0, 9.0], true).powers(12), [1.0, 2.0, 5.0, 10.0]);
        assert_eq!(Axis::new(vec![1e-3, 1e3], true).powers(12).len(), 7);
    }

    #[test]
    fn a_chart_that_cannot_be_written_names_its_file() {
        let nowhere = Chart::default().write(Path::new("no/such/folder.svg"));
        assert!(nowhere.is_err_and(|error| error.contains("folder.svg")));
    }
}
