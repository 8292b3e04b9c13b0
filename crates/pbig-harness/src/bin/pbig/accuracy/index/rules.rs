//! The paper's rules: what they mend, and the smallest number of boxes for which they do not.

use super::super::study::{Cell, Table, plain};
use super::times::label;
use super::{Every, Found};
use pbig_harness::index::{Correction, Counterexample, Rules, WAYS, Way};
use pbig_harness::pair_index::{pair_count, pair_of};
use rayon::prelude::*;

/// A way, how far counterexamples were searched, and what was found.
pub(super) struct Searched {
    pub(super) way: Way,
    most: i64,
    pub(super) found: Option<Counterexample>,
}

impl Searched {
    /// Describes the results of the rules at the ends of rows.
    pub(super) fn ends(&self) -> String {
        match self.found {
            Some(it) => format!("at the ends of rows they are wrong from n = {} on", it.n),
            None => format!("at the ends of rows they are right up to n = {}", self.most),
        }
    }
}

pub(super) fn counterexamples(quick: bool) -> Vec<Searched> {
    // Of two steps it takes seconds.
    let most = if quick { 1 << 16 } else { 1 << 20 };
    WAYS.par_iter().map(|way| Searched { way: *way, most, found: (way.counterexample)(most) }).collect()
}

pub(super) fn table(searched: &[Searched]) -> Table {
    let title =
        "The smallest n for which the paper's rules give a wrong pair at an end of a row, counted from 0";
    let columns = ["root", "searched_up_to", "boxes", "index", "given", "right"];
    let mut table = Table::new("counterexamples", title, &columns);
    for Searched { way, most, found } in searched {
        let pair = |(a, b): (i64, i64)| format!("({a}, {b})");
        table.row([
            label(way).into(),
            (*most as u64).into(),
            found.map(|it| it.n as u64).into(),
            found.map(|it| it.k as u64).into(),
            found.map_or("none".into(), |it| pair(it.given).into()),
            Cell::from(found.map(|it| pair(it.right))),
        ]);
    }
    table
}

pub(super) fn notes(found: &Found) -> [String; 4] {
    let Found { every, counterexamples, .. } = found;
    [mended_note(MENDED), wrong_note(counterexamples), ends_note(every, counterexamples), left_note(every)]
}

/// Up to how many boxes rows are moved to see what is mended.
const MENDED: i64 = 60;

/// By how many rows an estimate may be off so that the rules mend it for every pair of up to so many boxes; and by how
/// many so that they never do.
fn mended(most: i64) -> (Vec<i64>, Vec<i64>) {
    let is_mended = |off: i64, n: i64, k: u64| {
        let (a, b) = pair_of(k, n as u64);
        Rules::pair(a as i64 + off, k as i64, n) == (a as i64, b as i64)
    };
    let all =
        |off: i64| (2..=most).flat_map(move |n| (0..pair_count(n as u64)).map(move |k| is_mended(off, n, k)));
    let always = (-3..=3).filter(|&off| all(off).all(|is| is)).collect();
    (always, (-3..=3).filter(|&off| !all(off).any(|is| is)).collect())
}

fn mended_note(most: i64) -> String {
    let (always, never) = mended(most);
    let told = |offs: &[i64]| match offs {
        [] => "none".to_owned(),
        offs => offs.iter().map(|off| format!("{off:+}")).collect::<Vec<_>>().join(", "),
    };
    format!(
        "Rows off by -3 to 3, of all pairs of up to {most} boxes: the paper's rules always give the right pair \
         for those off by {}, and never for {}.",
        told(&always),
        told(&never)
    )
}

fn wrong_note(searched: &[Searched]) -> String {
    let wrong = searched.iter().filter_map(|it| Some((label(&it.way), it.found?)));
    let wrong: Vec<_> =
        wrong.map(|(name, it)| format!("{name} from n = {} on (index {})", it.n, it.k)).collect();
    let most = searched.first().map_or(0, |it| it.most);
    let none: Vec<_> = searched.iter().filter(|it| it.found.is_none()).map(|it| label(&it.way)).collect();
    let none = if none.is_empty() { "no root".to_owned() } else { none.join(", ") };
    if wrong.is_empty() {
        return format!(
            "No wrong pair is left by the rules at the ends of rows, up to n = {most}, with any root: {none}."
        );
    }
    format!(
        "The paper's rules are not always right. Wrong: {}. No wrong pair at the ends of rows up to n = {most}: \
         {none}.",
        wrong.join(", ")
    )
}

/// Counterexamples are looked for at the ends of rows; how that compares with looking at all pairs.
fn ends_note(every: &[Every], searched: &[Searched]) -> String {
    let others = every.iter().zip(searched).filter(|(every, it)| differ(every, it.found.map(|it| it.n)));
    let others: Vec<_> = others.map(|(every, _)| label(&every.way)).collect();
    let agree = if others.is_empty() {
        "that found no other first n, with any root".to_owned()
    } else {
        format!("that found another first n with {}", others.join(", "))
    };
    format!(
        "Counterexamples are looked for at the first and last index of rows, where an estimate is furthest off if \
         the root is monotone. Newton's are not quite, so that the smallest n could be a little smaller than told: {}. As \
         far as all pairs were looked at, too, {agree}.",
        bounds(searched)
    )
}

/// Of Newton's roots: below which n the rules cannot leave a wrong pair.
fn bounds(searched: &[Searched]) -> String {
    let newtons = searched.iter().filter(|it| it.way.steps.is_some() && it.found.is_some());
    let told = newtons.map(|it| format!("with {} not below {}", label(&it.way), harmless_below(&it.way)));
    let told: Vec<_> = told.collect();
    if told.is_empty() { "none was found".to_owned() } else { told.join(", ") }
}

/// The rules mend a row that is off by one. To be off by two, an estimate `(m - s) / 2` has to be off by more than one, with
/// `m` and the root below `2n`: by the relative error of the root, and a rounding each of what stands under it (half of that
/// is left of it in the root), of the root, and of the difference. (The error of a root has its own rounding already: slack.)
fn harmless_below(way: &Way) -> i64 {
    let roundings = 2.5 * f64::from(f32::EPSILON) / 2.0;
    (1.0 / ((way.worst_relative)() + roundings)) as i64
}

/// Returns true if the first wrong n differs between all pairs and the ends of rows.
fn differ(every: &Every, ends: Option<i64>) -> bool {
    let all = every.first[1];
    let is_earlier = all.is_some_and(|n| ends.is_none_or(|at_ends| n < at_ends));
    is_earlier || ends.is_some_and(|n| every.boxes.contains(&n) && all != Some(n))
}

fn left_note(every: &[Every]) -> String {
    let left = every.iter().filter(|every| every.tallies[1].wrong > 0).map(|every| {
        let (share, tally) = (plain(every.percent(1)), every.tallies[1]);
        format!("{} {share}% of all pairs looked at, {} missed", label(&every.way), tally.missed)
    });
    let left: Vec<_> = left.collect();
    format!("Left wrong by the rules: {}.", if left.is_empty() { "none".into() } else { left.join("; ") })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rules_mend_rows_that_are_off_by_one() {
        assert_eq!(mended(20), (vec![-1, 0, 1], vec![-3, -2, 2, 3]));
        assert!(
            mended_note(20).contains("off by -1, +0, +1, and never for -3, -2, +2, +3."),
            "{}",
            mended_note(20)
        );
    }

    #[test]
    fn what_is_said_of_the_rules_depends_on_what_was_found() {
        let example = Counterexample { n: 643, k: 641, given: (2, 3), right: (0, 642) };
        let one = |found| [Searched { way: WAYS[2], most: 1000, found }];
        let told = wrong_note(&one(Some(example)));
        assert!(told.contains("not always right. Wrong: Carmack 1 from n = 643 on (index 641)."), "{told}");
        let told = wrong_note(&one(None));
        assert!(told.starts_with("No wrong pair is left") && told.ends_with(": Carmack 1."), "{told}");
    }

    #[test]
    fn below_what_the_error_of_a_root_allows_there_is_no_counterexample() {
        for way in WAYS.iter().filter(|way| way.steps.is_some_and(|steps| steps < 3)) {
            let (most, found) = (1 << 18, (way.counterexample)(1 << 18).expect("a counterexample").n);
            let least = harmless_below(way);
            assert!(
                least <= found && 10 * found < 12 * least,
                "{}: {least} and {found} up to {most}",
                label(way)
            );
        }
    }

    #[test]
    fn another_first_n_of_all_pairs_is_told() {
        let every = Every::of(&WAYS[2], true);
        assert_eq!(every.first[1], Some(1000), "the first that is wrong of those looked at");
        // Of 643 boxes not all pairs were looked at, of 200 they were.
        let told = [Some(643), Some(1000), Some(200), Some(1001), None].map(|ends| differ(&every, ends));
        assert_eq!(told, [false, false, true, true, true]);
        let searched = |n| {
            let found = Some(Counterexample { n, k: 641, given: (2, 3), right: (0, 642) });
            [Searched { way: WAYS[2], most: 1000, found }]
        };
        let told = ends_note(std::slice::from_ref(&every), &searched(643));
        assert!(told.ends_with("no other first n, with any root."), "{told}");
        let told = ends_note(&[every], &searched(200));
        assert!(told.ends_with("another first n with Carmack 1."), "{told}");
    }
}
