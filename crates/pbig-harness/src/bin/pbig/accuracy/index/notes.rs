//! The findings of the study of indices, in words.

use super::super::study::plain;
use super::times::{Times, label};
use super::{Found, ends, exact, paper, percent, roundings, rules};
use pbig_harness::index::{CORRECTIONS, LAZY, MOST_EXHAUSTIVE};
use pbig_harness::pair_index::pair_of;

pub(super) fn notes(found: &Found) -> Vec<String> {
    let mut notes = vec![
        "What stands under the root is an exact 64-bit integer, rounded once, but for two ways that compute \
         equation 1 step by step in f32, as a device without such integers would: `all in f32` with rows counted \
         from 0, `as printed, in f32` with rows from 1 and every term in the paper's order. Indices are counted \
         from 0 in both, as they are in the paper. The row is what is left without the fraction. By integers \
         nothing was wrong, whatever the root: a run in which something is fails."
            .to_owned(),
        "`Carmack 2` is two steps of Newton from Carmack's constant. Missed: pairs that no index gives, (a, b) or \
         (b, a), and that are not tested. Doubled: tests of a pair that another index tests, too. No pair: \
         indices that give (a, a) or a box that there is not. Missed are as many as doubled and no pair together."
            .to_owned(),
    ];
    notes.push(doubled_note(found));
    notes.push(format!(
        "Beyond {MOST_EXHAUSTIVE} boxes the first and last index of every row are looked at, and others evenly at \
         random; what is missed and doubled is not counted there."
    ));
    notes.push(exact::told(&found.exact));
    notes.push(ends::note(&found.every));
    notes.push(sign_note());
    notes.extend(rules::notes(found));
    notes.extend([table_2_note(), root_note(found), lazy_note(found)]);
    notes.extend([paper::table_3_note(&found.table_3), roundings::note(), roundings::squares_note()]);
    notes.push(paper::table_4_note(&found.table_4));
    notes.extend([fastest_note(found), each_size_note(found)]);
    notes
}

/// Compares the errors with Avril's statement.
fn doubled_note(Found { every, .. }: &Found) -> String {
    let told = every.iter().filter(|every| every.tallies[0].wrong > 0).map(|every| {
        let tally = every.tallies[0];
        let share = |part: u64| plain(percent(part, tally.wrong));
        format!("{} {}% and {}%", label(&every.way), share(tally.doubled), share(tally.none))
    });
    let told: Vec<_> = told.collect();
    let told = if told.is_empty() { "no root was wrong".to_owned() } else { told.join("; ") };
    format!(
        "Avril 3.3 says that an error makes two threads compute the same pair. Of the wrong indices without a \
         correction, those that double a test, and those that test no pair at all: {told}."
    )
}

/// The text of 3.3 adds 8k under the root, equation 1 subtracts it.
fn sign_note() -> String {
    let n = 1000;
    let [plus, minus] = [8, -8].map(|eight| wrong_percent(n, eight));
    let verdict = match (plus > 0.0, minus > 0.0) {
        (true, false) => "equation 1 has the right sign",
        (false, true) => "the text has the right sign",
        _ => "that does not tell which sign is right",
    };
    format!(
        "With `+ 8k` under the root, as the text of 3.3 has it, {}% of the pairs of {n} boxes are wrong, with `- \
         8k`, as equation 1 has it, {}%: {verdict}.",
        plain(plus),
        plain(minus)
    )
}

/// With so many k under an f64 root.
fn wrong_percent(n: i64, eight: i64) -> f64 {
    let (m, pairs) = (2 * n - 1, n * (n - 1) / 2);
    let row = |k: i64| ((m as f64 - ((m * m + eight * k) as f64).sqrt()) / 2.0).floor() as i64;
    let wrong = (0..pairs).filter(|&k| row(k) != pair_of(k as u64, n as u64).0 as i64).count();
    percent(wrong as u64, pairs as u64)
}

/// Times that grow with the objects cannot be of all their pairs.
fn table_2_note() -> String {
    let [first, .., last] = paper::TABLE_2;
    let pairs = paper::pairs(last.0) as f64 / paper::pairs(first.0) as f64;
    let (objects, time) = (last.0 as f64 / first.0 as f64, last.1 / first.1);
    let verdict = if time < pairs / 10.0 {
        "So it cannot be the time for n (n - 1) / 2 pairs at each of these sizes"
    } else {
        "So it may be the time for n (n - 1) / 2 pairs at each of these sizes"
    };
    format!(
        "Table 2 of the paper: from {} to {} objects there are {} times the objects and {} times the pairs, and \
         its time grows {} times. {verdict}.",
        first.0,
        last.0,
        plain(objects),
        plain(pairs),
        plain(time)
    )
}

/// Which root stands beside the paper's in table 2, and whether it is right.
fn root_note(Found { every, counterexamples, .. }: &Found) -> String {
    let right = |fix: usize| match every[0].first[fix] {
        Some(n) => format!("{} it is wrong from n = {n} on", CORRECTIONS[fix]),
        None => format!("{} it is right for all pairs up to n = {}", CORRECTIONS[fix], every[0].most()),
    };
    format!(
        "Table 2, ours with a root: the processor's f32 root ({}), as the paper's is CUDA's at that point; {}, by {}; {}.",
        label(&every[0].way),
        right(0),
        right(1),
        counterexamples[0].ends()
    )
}

/// Compares the lazy way with a root, over the paper's sizes.
fn lazy_note(found: &Found) -> String {
    let of_paper = |times: &&Times| paper::TABLE_2.iter().any(|row| row.0 == times.n as u64);
    let sizes: Vec<String> = found.times.iter().filter(of_paper).map(|times| times.n.to_string()).collect();
    let over = |root: fn(&Times) -> f64| {
        let ratios = found.times.iter().filter(of_paper).map(|times| times.lazy() / root(times));
        let (least, most) = ratios.fold((f64::MAX, 0.0f64), |(a, b), ratio| (a.min(ratio), b.max(ratio)));
        format!("{least:.2} to {most:.2}")
    };
    let wide = if is_right(found, 1, 0) { "never wrong here" } else { "wrong for some pairs here" };
    format!(
        "Table 2, the lazy way on a CPU. {LAZY} Here only pairs are made; in [papers](papers.md) their boxes are tested, too. \
         The lazy way takes {} times as long as the f32 root with the paper's rules, and {} times as long as the f64 root \
         without a correction, which is {wide}, with {} boxes. Section 3.2.2 of the paper has it four times as fast as its root, on its CPU.",
        over(|times| times.f32_root()[1]),
        over(Times::f64_root),
        sizes.join(", ")
    )
}

/// Fewer boxes have few pairs, and what a loop over them begins with counts, too.
const MANY: i64 = 1000;

fn of_many(found: &Found) -> impl Iterator<Item = &Times> {
    found.times.iter().filter(|times| times.n >= MANY)
}

/// Ways with their corrections that nothing was wrong with, wherever they were looked at, and the others: ns by size.
fn right_ones(found: &Found) -> Vec<(String, Vec<f64>)> {
    let ways = (0..found.every.len()).flat_map(|way| (0..CORRECTIONS.len()).map(move |fix| (way, fix)));
    let ways = ways.filter(|&(way, fix)| is_right(found, way, fix)).map(|(way, fix)| {
        let name = format!("{}, {}", label(&found.every[way].way), CORRECTIONS[fix]);
        (name, of_many(found).map(|times| times.ways[way][fix]).collect())
    });
    let exact = found
        .exact
        .iter()
        .enumerate()
        .filter(|(_, one)| one.tally.wrong == 0)
        .map(|(k, one)| (one.name.to_owned(), of_many(found).map(|times| times.exact[k]).collect()));
    ways.chain(exact).collect()
}

fn is_right(found: &Found, way: usize, fix: usize) -> bool {
    let mut sizes = found.sizes.iter().filter(|size| size.way == way);
    let by_rules = fix == 1 && found.counterexamples[way].found.is_some();
    found.every[way].tallies[fix].wrong == 0 && sizes.all(|size| size.is_right(fix)) && !by_rules
}

/// By the geometric mean over the larger sizes that were timed.
fn fastest_note(found: &Found) -> String {
    let mean = |ns: &[f64]| (ns.iter().map(|ns| ns.ln()).sum::<f64>() / ns.len().max(1) as f64).exp();
    let mut right = right_ones(found);
    right.sort_by(|a, b| mean(&a.1).total_cmp(&mean(&b.1)));
    let told = right.iter().take(6).map(|(name, ns)| {
        let (least, most) =
            (ns.iter().copied().fold(f64::MAX, f64::min), ns.iter().copied().fold(0.0, f64::max));
        format!("{name} {:.1} ns ({least:.1} to {most:.1})", mean(ns))
    });
    let most = found.sizes.iter().map(|size| size.n).max().unwrap_or(0);
    format!(
        "Never wrong wherever looked at, up to {most} boxes (ways without an estimate up to what is told above), \
         fastest first by the geometric mean over {} boxes: {}. (With fewer, what a loop begins with counts, too: the table has them.)",
        timed(found).join(", "),
        told.collect::<Vec<_>>().join("; ")
    )
}

fn timed(found: &Found) -> Vec<String> {
    of_many(found).map(|times| times.n.to_string()).collect()
}

/// Says if the order depends on the number of boxes.
fn each_size_note(found: &Found) -> String {
    let right = right_ones(found);
    let first = |k: usize| right.iter().min_by(|a, b| a.1[k].total_cmp(&b.1[k]));
    let told = timed(found).into_iter().enumerate();
    let told =
        told.filter_map(|(k, n)| first(k).map(|(name, ns)| format!("{n} boxes: {name}, {:.1} ns", ns[k])));
    format!("The fastest of these by size: {}.", told.collect::<Vec<_>>().join("; "))
}

#[cfg(test)]
mod tests {
    use super::super::Every;
    use super::*;
    use pbig_harness::index::{EXACT, WAYS};

    #[test]
    fn the_right_sign_is_that_of_equation_1() {
        assert_eq!(wrong_percent(300, -8), 0.0);
        assert!(wrong_percent(300, 8) > 90.0);
        assert!(sign_note().ends_with("equation 1 has the right sign."), "{}", sign_note());
    }

    /// At two of the paper's sizes the first exact way takes 1 and 9 ns, the second 4 and 4, the third 8 and 1; all with a
    /// root 5. And at one that is small, where all take more.
    fn made() -> Found {
        let times = |n, exact| Times { n, ways: [[5.0; 3]; WAYS.len()], exact };
        Found {
            every: WAYS
                .iter()
                .map(|way| Every { way: *way, boxes: vec![9], ..Every::of(way, true) })
                .collect(),
            exact: exact::tallied(true),
            sizes: vec![],
            times: vec![times(16, [90.0; 3]), times(1000, [1.0, 4.0, 8.0]), times(10_000, [9.0, 4.0, 1.0])],
            counterexamples: rules::counterexamples(true),
            table_3: paper::table_3(true),
            table_4: paper::table_4(true),
            quick: true,
        }
    }

    #[test]
    fn the_lazy_way_is_held_against_roots_that_are_right() {
        let told = lazy_note(&made());
        assert!(told.contains("0.20 to 1.60 times as long as the f32 root"), "{told}");
        let roots =
            "as the f64 root without a correction, which is never wrong here, with 1000, 10000 boxes.";
        assert!(told.contains(roots), "{told}");
        let mut found = made();
        found.every[1].tallies[0].wrong = 1;
        assert!(lazy_note(&found).contains("which is wrong for some pairs here, "));
    }

    #[test]
    fn what_is_fastest_is_ranked_over_larger_sizes_and_by_each() {
        let mut found = made();
        let told = fastest_note(&found);
        let order = [
            "lazy way 2.8 ns (1.0 to 8.0)",
            "bisection over rows 3.0 ns (1.0 to 9.0)",
            "integer root 4.0 ns",
        ];
        let places: Vec<_> = order.iter().map(|part| told.find(part).expect(part)).collect();
        assert!(places.is_sorted(), "{told}");
        assert!(!told.contains("Carmack 1, the paper's rules"), "wrong ones have no place: {told}");
        let by_size = each_size_note(&found);
        assert_eq!(by_size.matches(EXACT[0].name).count(), 1);
        assert!(!by_size.contains("16 boxes") && by_size.contains("10000 boxes: lazy way"), "{by_size}");
        found.exact[2].tally.wrong = 1;
        assert!(!fastest_note(&found).contains("lazy way"), "{}", fastest_note(&found));
    }

    #[test]
    fn wrong_indices_double_a_test_or_test_no_pair() {
        let mut found = made();
        let told = doubled_note(&found);
        assert!(told.contains("Carmack 1 ") && !told.contains("f64 sqrt"), "{told}");
        found.every.clear();
        assert!(doubled_note(&found).ends_with("no root was wrong."));
    }
}
