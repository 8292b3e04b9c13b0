//! When worlds fall asleep, and what keeps them awake: that tells why steps of one world take longer than those of another
//! that moves no more than it.

use super::Ways;
use super::figures::Figures;
use rapier3d::prelude::RigidBodyActivation;

/// Describes the runs that fall asleep; nothing if there is none.
pub(super) fn note(scenes: &[Ways]) -> String {
    let told = |tell: fn(&Ways) -> Option<String>| {
        let told: Vec<String> = scenes.iter().filter_map(tell).collect();
        if told.is_empty() { "none".to_owned() } else { told.join("; ") }
    };
    let until_sleep = RigidBodyActivation::default_time_until_sleep();
    format!(
        "Asleep. Rapier lets bodies sleep that have been slow for {until_sleep} s, all that touch each other at once. It \
         wakes both bodies of a pair that ends while they touch, for {until_sleep} s more. With a margin a contact ends before its pair does; boxes \
         without one reach no further than rapier looks for contacts, so that the pair can end first (parted in contact). \
         Asleep from which step on, and so many pairs that parted in contact: {}. The time of a step is the \
         median: of a world that is asleep for most of its steps, or of one that is not. Runs of these scenes that are awake for more \
         than half of their steps: {}.",
        told(asleep),
        told(mostly_awake)
    )
}

/// The runs of a scene that are told of one by one.
fn runs(ways: &Ways) -> impl Iterator<Item = &Figures> {
    [ways.first()].into_iter().chain(ways.held())
}

fn falls_asleep(ways: &Ways) -> bool {
    runs(ways).any(|run| run.asleep.is_some())
}

fn asleep(ways: &Ways) -> Option<String> {
    let of = |run: &Figures| {
        let from = run.asleep.map_or_else(|| "never".to_owned(), |step| format!("from {step} on"));
        format!("{} {from} ({})", run.way, run.parted)
    };
    let all: Vec<String> = runs(ways).map(of).collect();
    falls_asleep(ways).then(|| format!("{}: {}", ways.scene, all.join(", ")))
}

fn mostly_awake(ways: &Ways) -> Option<String> {
    let is_awake = |run: &&Figures| run.asleep.is_none_or(|step| 2 * step > run.steps);
    let names: Vec<&str> = runs(ways).filter(is_awake).map(|run| run.way).collect();
    (falls_asleep(ways) && !names.is_empty()).then(|| format!("{} with {}", ways.scene, names.join(", ")))
}

#[cfg(test)]
mod tests {
    use super::super::figures::tests::nothing;
    use super::super::sides::WAYS;
    use super::*;

    /// All runs asleep from this step on, of 100, but those without a margin.
    fn made(scene: &'static str, asleep: Option<usize>, without: Option<usize>) -> Ways {
        let run = |way: &super::super::sides::Way| {
            let is_without = way.name == "pbig without margin";
            let (asleep, parted) = if is_without { (without, 5) } else { (asleep, 0) };
            Figures { way: way.name, asleep, parted, ..nothing() }
        };
        Ways { scene, runs: WAYS.iter().map(run).collect(), instants: vec![], repeats: vec![] }
    }

    #[test]
    fn what_falls_asleep_late_is_told_with_the_pairs_that_parted() {
        let told = note(&[made("pile", Some(44), Some(72)), made("cloud", None, None)]);
        let each = ": pile: stock from 44 on (0), stock sorted from 44 on (0), pbig lower first from 44 on (0), pbig from 44 on \
                    (0), pbig without margin from 72 on (5). ";
        assert!(told.contains(each), "{told}");
        assert!(told.ends_with("half of their steps: pile with pbig without margin."), "{told}");
    }

    #[test]
    fn a_scene_that_never_sleeps_or_soon_is_no_exception() {
        let told = note(&[made("pile", Some(50), Some(50)), made("cloud", None, None)]);
        assert!(told.ends_with("half of their steps: none."), "{told}");
        assert!(note(&[made("cloud", None, None)]).contains("in contact: none. "));
        assert!(note(&[made("pile", Some(44), None)]).contains("without margin never (5)"));
    }
}
