//! Charts on which a power is a straight line, with its exponent in the legend.

use super::{COLOURS, owned};
use plotters::prelude::*;
use std::path::Path;

/// Points of one measurement, in ascending order of x.
#[derive(Clone)]
pub struct Line {
    /// For the legend.
    pub name: String,
    /// Both above zero; others are left out.
    pub points: Vec<(f64, f64)>,
}

/// Lines over logarithmic axes.
pub struct LogLog {
    /// Name of the file, without its extension.
    pub name: String,
    /// Above the chart.
    pub title: String,
    /// Along the x axis.
    pub x: &'static str,
    /// Along the y axis.
    pub y: &'static str,
    /// The lines.
    pub lines: Vec<Line>,
    /// True if the legend shows the growth of each line as a power. (A curve with a minimum is none.)
    pub exponents: bool,
}

/// The exponent `k` of the power `c x^k` that fits best (least squares of the logarithms); none for fewer
/// than three different x: two say nothing of how well it fits.
pub fn growth(points: &[(f64, f64)]) -> Option<f64> {
    let logs: Vec<(f64, f64)> = drawn(points).map(|(x, y)| (x.ln(), y.ln())).collect();
    let n = logs.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| logs.iter().map(of).sum::<f64>() / n;
    let (x0, y0) = (mean(|p| p.0), mean(|p| p.1));
    let spread: f64 = logs.iter().map(|(x, _)| (x - x0) * (x - x0)).sum();
    let common: f64 = logs.iter().map(|(x, y)| (x - x0) * (y - y0)).sum();
    let are_three = |first: f64| {
        let mut others = logs.iter().map(|p| p.0).filter(|x| *x != first);
        others.next().is_some_and(|second| others.any(|third| third != second))
    };
    logs.first().is_some_and(|p| are_three(p.0)).then(|| common / spread)
}

fn drawn(points: &[(f64, f64)]) -> impl Iterator<Item = (f64, f64)> {
    points.iter().copied().filter(|&(x, y)| x > 0.0 && y > 0.0 && x.is_finite() && y.is_finite())
}

/// Many points on the lines between those that are drawn.
fn along(points: &[(f64, f64)]) -> impl Iterator<Item = (f64, f64)> {
    const BETWEEN: usize = 16;
    let between = |((x, y), (u, v)): ((f64, f64), (f64, f64))| {
        (0..=BETWEEN)
            .map(move |i| i as f64 / BETWEEN as f64)
            .map(move |t| (x * (u / x).powf(t), y * (v / y).powf(t)))
    };
    drawn(points).zip(drawn(points).skip(1)).flat_map(between)
}

impl LogLog {
    /// Writes the chart.
    ///
    /// # Errors
    /// A message that names the file, when it cannot be written.
    pub fn write(&self, path: &Path) -> Result<(), String> {
        self.draw(path).map_err(|error| format!("{}: cannot write the chart: {error}", path.display()))
    }

    /// From the smallest to the largest, a little more on both sides.
    fn range(&self, of: fn((f64, f64)) -> f64) -> std::ops::Range<f64> {
        let values = || self.lines.iter().flat_map(|line| drawn(&line.points)).map(of);
        let (low, high) = (values().fold(f64::MAX, f64::min), values().fold(0.0, f64::max));
        if low > high { 1.0..10.0 } else { low / 1.3..high * 1.3 }
    }

    /// Returns the corner where the legend hides least of the lines.
    fn emptiest_corner(&self) -> SeriesLabelPosition {
        use SeriesLabelPosition::{LowerLeft, LowerRight, UpperLeft, UpperRight};
        let corners =
            [(UpperLeft, 0.0, 1.0), (UpperRight, 1.0, 1.0), (LowerLeft, 0.0, 0.0), (LowerRight, 1.0, 0.0)];
        let (xs, ys) = (self.range(|p| p.0), self.range(|p| p.1));
        let share =
            |x: f64, range: &std::ops::Range<f64>| (x / range.start).ln() / (range.end / range.start).ln();
        // Of the chart; a line of the legend is a text of up to 50 letters.
        let (width, height) = (0.4, 0.04 + 0.045 * self.lines.len() as f64);
        let hidden = |&(_, right, top): &(SeriesLabelPosition, f64, f64)| {
            let is_hidden = |&(x, y): &(f64, f64)| {
                (share(x, &xs) - right).abs() < width && (share(y, &ys) - top).abs() < height
            };
            self.lines.iter().flat_map(|line| along(&line.points)).filter(is_hidden).count()
        };
        corners.into_iter().min_by_key(hidden).map_or(UpperLeft, |corner| corner.0)
    }

    fn draw(&self, path: &Path) -> Result<(), Box<dyn std::error::Error>> {
        let root = SVGBackend::new(path, (960, 540)).into_drawing_area();
        root.fill(&WHITE)?;
        let mut chart = ChartBuilder::on(&root)
            .caption(&self.title, ("sans-serif", 20))
            .margin(12)
            .x_label_area_size(40)
            .y_label_area_size(70)
            .build_cartesian_2d(self.range(|p| p.0).log_scale(), self.range(|p| p.1).log_scale())
            .map_err(owned)?;
        let plain = |value: &f64| format!("{value}");
        let mut mesh = chart.configure_mesh();
        mesh.x_desc(self.x).y_desc(self.y).x_label_formatter(&plain).y_label_formatter(&plain);
        mesh.light_line_style(WHITE).draw().map_err(owned)?;
        for (line, colour) in self.lines.iter().zip(COLOURS) {
            let exponent = growth(&line.points).filter(|_| self.exponents);
            let exponent = exponent.map_or(String::new(), |k| format!(" (grows as x^{k:.2})"));
            chart
                .draw_series(LineSeries::new(drawn(&line.points), colour.stroke_width(2)).point_size(3))
                .map_err(owned)?
                .label(format!("{}{exponent}", line.name))
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 20, y)], colour.stroke_width(3)));
        }
        let mut labels = chart.configure_series_labels();
        labels.position(self.emptiest_corner()).background_style(WHITE.mix(0.8)).border_style(BLACK);
        labels.draw().map_err(owned)?;
        drop(labels);
        drop(chart);
        root.present().map_err(owned)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_exponent_of_a_power_is_found() {
        let square: Vec<(f64, f64)> = [1.0, 10.0, 50.0].map(|x| (x, 3.0 * x * x)).to_vec();
        assert!((growth(&square).expect("three points") - 2.0).abs() < 1e-9);
        assert_eq!(growth(&square[..1]), None);
        assert_eq!(growth(&square[..2]), None);
        assert_eq!(growth(&[square[0], square[1], square[0]]), None, "two different ones");
        assert_eq!(growth(&[(1.0, 0.0), square[0], square[1]]), None, "zero has no logarithm");
    }

    #[test]
    fn the_legend_goes_where_no_line_is() {
        let rising: Vec<(f64, f64)> = [1.0, 10.0, 100.0].map(|x| (x, x)).to_vec();
        let falling: Vec<(f64, f64)> = [1.0, 10.0, 100.0].map(|x| (x, 1.0 / x)).to_vec();
        let corner = |points: &[&Vec<(f64, f64)>]| {
            let line = |points: &&Vec<(f64, f64)>| Line { name: String::new(), points: points.to_vec() };
            let lines = points.iter().map(line).collect();
            let (name, title, exponents) = (String::new(), String::new(), true);
            LogLog { name, title, x: "", y: "", lines, exponents }.emptiest_corner()
        };
        assert!(matches!(corner(&[&rising]), SeriesLabelPosition::UpperLeft));
        assert!(matches!(corner(&[&falling]), SeriesLabelPosition::UpperRight));
        let low: Vec<(f64, f64)> = [1.0, 3.0, 100.0].map(|x: f64| (x, x.min(1.01))).to_vec();
        assert!(matches!(corner(&[&rising, &low]), SeriesLabelPosition::UpperLeft));
    }

    #[test]
    fn a_chart_names_its_lines_and_their_growth() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("chart.svg");
        let line = |name: &str, k| Line {
            name: name.into(),
            points: [1e2, 1e3, 1e4, 1e5, 1e6, 1e7].map(|x: f64| (x, 1e-5 * x.powf(k))).into(),
        };
        let lines =
            vec![line("linear", 1.0), line("steeper", 1.25), Line { name: "empty".into(), points: vec![] }];
        let title = "time by stage".to_owned();
        let mut chart = LogLog { name: "chart".into(), title, x: "boxes", y: "ms", lines, exponents: true };
        chart.write(&path).expect("written");
        let text = std::fs::read_to_string(&path).expect("text");
        for word in
            ["time by stage", "boxes", "linear (grows as x^1.00)", "steeper (grows as x^1.25)", "empty"]
        {
            assert!(text.contains(word), "{word}");
        }
        chart.exponents = false;
        chart.write(&path).expect("written again");
        let text = std::fs::read_to_string(&path).expect("text");
        assert!(text.contains("linear") && !text.contains("grows"));
        let nowhere = chart.write(&folder.path().join("no/such/folder.svg"));
        assert!(nowhere.is_err_and(|error| error.contains("folder.svg")));
    }
}
