//! Which of some ways takes least where, and how far what is planned is from that: in words, from what was measured.

use pbig_harness::chart::Line;

/// Where each of these lines is the lowest: `edits at 1%, 3%; near pairs at 100%`.
pub(super) fn winners(lines: &[&Line], at: fn(f64) -> String) -> String {
    let of = |line: &&&Line| {
        let won = line.points.iter().filter(|(x, ms)| least(lines, *x) == Some(*ms));
        let won: Vec<String> = won.map(|(x, _)| at(*x)).collect();
        (!won.is_empty()).then(|| format!("{} at {}", line.name, won.join(", ")))
    };
    lines.iter().filter_map(|line| of(&line)).collect::<Vec<_>>().join("; ")
}

/// How much more the planned one takes than the least of the others, at worst and on average: none where there are none.
pub(super) fn regret(planned: &Line, others: &[&Line], at: fn(f64) -> String) -> Option<String> {
    let times = |&(x, ms): &(f64, f64)| least(others, x).map(|best| (x, ms / best));
    let times: Vec<(f64, f64)> = planned.points.iter().filter_map(times).collect();
    let worst = times.iter().copied().max_by(|a, b| a.1.total_cmp(&b.1))?;
    let mean = (times.iter().map(|(_, times)| times.ln()).sum::<f64>() / times.len() as f64).exp();
    Some(format!(
        "{} takes {:.2} times as long as the best of them at worst, at {}, and {mean:.2} times on average",
        planned.name,
        worst.1,
        at(worst.0)
    ))
}

/// The least at an x of all lines that have a point there.
fn least(lines: &[&Line], x: f64) -> Option<f64> {
    let there = lines.iter().flat_map(|line| &line.points).filter(|point| point.0 == x);
    there.map(|point| point.1).min_by(f64::total_cmp)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(name: &str, points: &[(f64, f64)]) -> Line {
        Line { name: name.into(), points: points.to_vec() }
    }

    #[test]
    fn the_lowest_line_wins_and_one_without_a_point_does_not() {
        let (a, b) = (line("a", &[(1.0, 5.0), (2.0, 5.0)]), line("b", &[(2.0, 4.0)]));
        let c = line("c", &[(1.0, 9.0), (2.0, 9.0)]);
        assert_eq!(winners(&[&a, &b, &c], |x| x.to_string()), "a at 1; b at 2");
    }

    #[test]
    fn regret_is_of_the_best_of_the_others() {
        let planned = line("planned", &[(1.0, 5.5), (2.0, 4.0), (3.0, 1.0)]);
        let (a, b) = (line("a", &[(1.0, 5.0), (2.0, 5.0)]), line("b", &[(2.0, 4.4)]));
        let text = regret(&planned, &[&a, &b], |x| x.to_string()).expect("two points in common");
        assert_eq!(
            text,
            "planned takes 1.10 times as long as the best of them at worst, at 1, and 1.00 times on average"
        );
        assert_eq!(regret(&planned, &[], |x| x.to_string()), None);
    }
}
