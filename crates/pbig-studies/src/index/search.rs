//! The errors of roots, and the smallest number of boxes for which the paper's rules are wrong.

use super::{AsItIs, Correction, Root, Rules, Single, SingleRoot, discriminant, row_start};

/// An index for which the rules of Avril 3.3 give a wrong pair.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Counterexample {
    /// Boxes.
    pub n: i64,
    /// The index.
    pub k: i64,
    /// The resulting pair.
    pub given: (i64, i64),
    /// Its pair.
    pub right: (i64, i64),
}

/// The smallest number of boxes up to `most <= 2^20` that has one at the first or last index of a row. An estimate by a
/// root that is monotone is furthest from its row there. Newton's are not quite: an index within a row could be wrong
/// at a number of boxes a little smaller, which only looking at all pairs could tell.
pub fn counterexample<R: Root>(most: i64) -> Option<Counterexample> {
    let least = least_root::<R>();
    let first = ((least / 2.0) as i64).max(2);
    (first..=most).find_map(|n| {
        // The root at the start of row `a` is `2n - 1 - 2a`.
        let rows = ((2 * n - 1) as f64 - least) / 2.0;
        (0..(rows.ceil() as i64 + 1).clamp(0, n - 1)).find_map(|row| {
            let ends = [row_start(row, n), row_start(row + 1, n) - 1];
            ends.into_iter().find_map(|k| wrong_by_rules::<R>(n, row, k))
        })
    })
}

/// The smallest root that can be off by more than one row, so by more than 2. Rounding to f32 adds an eighth at most
/// where roots are below 2^21: a sixteenth under the root, and another one in the subtraction.
fn least_root<R: Root>() -> f64 {
    1.875 / R::worst_relative()
}

fn wrong_by_rules<R: Root>(n: i64, row: i64, k: i64) -> Option<Counterexample> {
    let estimate = R::row(2 * n - 1, discriminant(k, n));
    if estimate.abs_diff(row) < 2 {
        return None;
    }
    let (given, right) = (Rules::pair(estimate, k, n), AsItIs::pair(row, k, n));
    (given != right).then_some(Counterexample { n, k, given, right })
}

/// For how many whole numbers `1 <= x < below` the root without its fraction is not that of the processor's f32 root:
/// Avril's table 3, where an error is a difference from "the computed square root". Up to 2^24 this is [`root_errors`].
/// Beyond, `x` is not always an f32; both roots are then of the f32 that it is rounded to.
pub fn root_differences<R: SingleRoot>(below: u32) -> u64 {
    let without_fraction = |root: f32| root as i32;
    let differs = |x: u32| {
        let x = x as i32 as f32;
        u32::from(without_fraction(R::root(x)) != without_fraction(Single::root(x)))
    };
    (1..below).map(differs).sum::<u32>().into()
}

/// For how many whole numbers `1 <= x < below` the root without its fraction is not that of `x`, which is exact.
pub fn root_errors<R: SingleRoot>(below: u32) -> u64 {
    let mut wrong = 0u64;
    let mut root = 1u32;
    while root * root < below {
        let end = (root + 1).pow(2).min(below);
        let differs = |x: u32| {
            let found = R::root(x as i32 as f32);
            u32::from(!((found >= root as f32) & (found < (root + 1) as f32)))
        };
        wrong += u64::from((root * root..end).map(differs).sum::<u32>());
        root += 1;
    }
    wrong
}

#[cfg(test)]
mod tests {
    use super::super::{CARMACK, Newton, Single, tally};
    use super::*;

    #[test]
    fn a_counterexample_is_one() {
        let found = counterexample::<Newton<CARMACK, 1>>(1000).expect("one step is off by two rows soon");
        assert_ne!(found.given, found.right);
        let estimate = Newton::<CARMACK, 1>::row(2 * found.n - 1, discriminant(found.k, found.n));
        assert_eq!(Rules::pair(estimate, found.k, found.n), found.given);
        assert_eq!(super::super::Integers::pair(estimate, found.k, found.n), found.right);
        // Before it, rules mend everything.
        for n in (2..found.n).step_by(31).chain([found.n - 1]) {
            assert_eq!(tally::all::<Newton<CARMACK, 1>>(n)[1].wrong, 0, "n {n}");
        }
    }

    #[test]
    fn from_2_to_the_24th_on_the_f32_root_is_not_the_exact_one() {
        type Two = Newton<CARMACK, 2>;
        for below in [2, 1000, 1 << 24] {
            assert_eq!(root_differences::<Two>(below), root_errors::<Two>(below), "below {below}");
        }
        assert_eq!(root_differences::<Single>(30_000_000), 0);
        assert!(root_errors::<Single>(30_000_000) > 0);
    }
}
