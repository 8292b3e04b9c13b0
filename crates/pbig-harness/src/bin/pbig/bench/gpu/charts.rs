//! Both backends against the number of boxes: where each wins.

use super::{Row, events};
use pbig_harness::chart::{Line, LogLog};

/// Shares of the updates that are drawn: few, and all.
const SHARES: [f64; 2] = [0.01, 1.0];

/// The medians of one kind of work, of the CPU and of the GPU.
struct Sides {
    what: String,
    /// By number of boxes.
    ms: Vec<(usize, [f64; 2])>,
}

/// A chart of searches and one of updates.
pub(super) fn both(name: &str, adapter: &str, rows: &[Row], updates: &[events::Row]) -> [LogLog; 2] {
    let chart = |of: &str, sides: &[Sides]| LogLog {
        name: format!("{name}-{of}"),
        title: format!("{of}: the CPU and {adapter}"),
        x: "boxes",
        y: "ms",
        lines: sides.iter().flat_map(lines).collect(),
        exponents: true,
    };
    [chart("search", &of_searches(rows)), chart("updates", &of_updates(updates))]
}

/// At which numbers of boxes the GPU takes less.
pub(super) fn in_words(rows: &[Row], updates: &[events::Row]) -> String {
    let all = of_searches(rows).into_iter().chain(of_updates(updates));
    all.map(|sides| won(&sides)).collect::<Vec<_>>().join("\n")
}

fn won(sides: &Sides) -> String {
    let less = sides.ms.iter().filter(|(_, [cpu, gpu])| gpu < cpu);
    let boxes: Vec<String> = less.map(|(boxes, _)| boxes.to_string()).collect();
    let at = if boxes.is_empty() { "nowhere".to_owned() } else { format!("at {}", boxes.join(", ")) };
    format!("{}: the GPU takes less {at}", sides.what)
}

fn of_searches(rows: &[Row]) -> Vec<Sides> {
    let mut sets: Vec<&str> = rows.iter().map(|row| row.set).collect();
    sets.sort_unstable();
    sets.dedup();
    let sides = |set: &str| {
        let of = rows.iter().filter(|row| row.set == set);
        let ms = of.map(|row| (row.boxes, [row.cpu.median, row.gpu.median])).collect();
        Sides { what: format!("search, {set}"), ms }
    };
    sets.into_iter().map(sides).collect()
}

fn of_updates(updates: &[events::Row]) -> Vec<Sides> {
    let sides = |share: f64| {
        let of = updates.iter().filter(|row| row.share == share);
        let ms = of.map(|row| (row.boxes, [row.cpu.median, row.gpu.median])).collect();
        Sides { what: format!("update, {}% moved", share * 100.0), ms }
    };
    SHARES.into_iter().map(sides).collect()
}

fn lines(sides: &Sides) -> [Line; 2] {
    [0, 1].map(|side| Line {
        name: format!("{}, {}", sides.what, ["CPU", "GPU"][side]),
        points: sides.ms.iter().map(|(boxes, ms)| (*boxes as f64, ms[side])).collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_at_which_the_gpu_takes_less_are_named_and_both_are_drawn() {
        let sides = Sides { what: "search, unit".into(), ms: vec![(1000, [1.0, 2.0]), (10_000, [9.0, 3.0])] };
        assert_eq!(won(&sides), "search, unit: the GPU takes less at 10000");
        let [cpu, gpu] = lines(&sides);
        assert_eq!((cpu.name.as_str(), gpu.name.as_str()), ("search, unit, CPU", "search, unit, GPU"));
        assert_eq!((cpu.points[1], gpu.points[1]), ((10_000.0, 9.0), (10_000.0, 3.0)));
        let none = Sides { ms: vec![(1000, [1.0, 2.0])], ..sides };
        assert!(won(&none).ends_with("nowhere"));
    }
}
