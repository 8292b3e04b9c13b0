//! The ends of rows as a sample of all pairs. The CPU tests both; kernels test the ends alone, for every n.

use super::super::study::Cell;
use super::Every;
use super::times::label;
use pbig_harness::index::{CORRECTIONS, Tally, Way};

/// Of values of n whose pairs were all looked at, by one way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Shown {
    /// Those with a wrong pair.
    pub(super) wrong: u64,
    /// Of these, those with none at an end of a row.
    pub(super) inside: u64,
    /// By how many rows the worst end is off.
    pub(super) worst_row: u64,
}

impl Shown {
    pub(super) fn and(self, other: Self) -> Self {
        Self {
            wrong: self.wrong + other.wrong,
            inside: self.inside + other.inside,
            worst_row: self.worst_row.max(other.worst_row),
        }
    }

    pub(super) fn cells(self) -> [Cell; 3] {
        [self.wrong, self.inside, self.worst_row].map(Cell::from)
    }
}

/// Of one n. Where no pair is wrong, none is at an end.
pub(super) fn shown(way: &Way, n: i64, tallies: &[Tally; 3]) -> [Shown; 3] {
    if tallies.iter().all(|tally| tally.wrong == 0) {
        return Default::default();
    }
    let at_ends = (way.sample)(n, &[]);
    std::array::from_fn(|fix| {
        let (is_wrong, ends) = (tallies[fix].wrong > 0, at_ends[fix]);
        let is_inside = is_wrong && ends.wrong_ends == 0;
        Shown { wrong: is_wrong.into(), inside: is_inside.into(), worst_row: ends.worst_row }
    })
}

/// Says how well the ends stand for all pairs, and where they do not.
pub(super) fn note(every: &[Every]) -> String {
    let most = every.iter().map(Every::most).max().unwrap_or(0);
    let inside = told(every, |_, shown| (shown.inside > 0).then_some([shown.inside, shown.wrong]));
    let less = told(every, |tally, shown| {
        (shown.worst_row < tally.worst_row).then_some([shown.worst_row, tally.worst_row])
    });
    format!(
        "Ends of rows in place of all pairs: an estimate that never falls where the index grows is right within a row where \
         it is at both ends, and off by no more there. Roots and differences that are rounded correctly keep that order; \
         Newton's steps need not. So both were looked at, for each n of the table of all pairs, up to {most}. Values of n \
         whose wrong pairs all lie inside rows, of those with wrong ones: {inside}. Largest row error at the ends, where that \
         of all pairs is larger: {less}."
    )
}

/// The ways for which there are two numbers to tell, one of the other.
fn told(every: &[Every], tell: fn(&Tally, &Shown) -> Option<[u64; 2]>) -> String {
    let of_one = |every: &Every, fix: usize| {
        let [part, whole] = tell(&every.tallies[fix], &every.at_ends[fix])?;
        Some(format!("{}, {} {part} of {whole}", label(&every.way), CORRECTIONS[fix]))
    };
    let all = every.iter().flat_map(|every| (0..CORRECTIONS.len()).filter_map(move |fix| of_one(every, fix)));
    let all: Vec<_> = all.collect();
    if all.is_empty() { "none with any way".to_owned() } else { all.join("; ") }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pbig_harness::index::{Sample, WAYS};

    /// Of these ways one end and two inner pairs are wrong from n = 5 on, of an even n by two rows; without a wrong end from
    /// n = 8 on.
    fn made() -> Way {
        let tally = |n: i64| {
            let worst_row = if n % 2 == 0 { 2 } else { 1 };
            let wrong = Tally { wrong: 3, worst_row, ..Tally::default() };
            [if n < 5 { Tally::default() } else { wrong }, Tally::default(), Tally::default()]
        };
        let sample = |n: i64, _: &[i64]| {
            let wrong = Sample { wrong_ends: 1, worst_row: 1, ..Sample::default() };
            [if n < 8 { wrong } else { Sample::default() }, Sample::default(), Sample::default()]
        };
        Way { tally, sample, ..WAYS[0] }
    }

    #[test]
    fn what_ends_do_not_show_is_counted_and_told() {
        let every = Every::of(&made(), true);
        let shown = Shown { wrong: 247, inside: 244, worst_row: 1 };
        assert_eq!(every.at_ends, [shown, Shown::default(), Shown::default()]);
        let told = note(&[every]);
        assert!(told.contains("with wrong ones: f32 sqrt, as it is 244 of 247. "), "{told}");
        assert!(told.ends_with("is larger: f32 sqrt, as it is 1 of 2."), "{told}");
    }

    #[test]
    fn where_ends_show_all_that_is_told() {
        let told = note(&[Every::of(&WAYS[0], true)]);
        assert!(told.ends_with("is larger: none with any way."), "{told}");
        assert_eq!(told.matches("none with any way").count(), 2);
    }
}
