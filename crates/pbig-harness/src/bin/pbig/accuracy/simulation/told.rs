//! The findings of whole runs, in words.

use super::super::study::plain;
use super::Ways;
use super::figures::{DISTANCE, Figures, Multiple, multiple};
use super::sides::{Moving, PERMUTED, WAYS};
use super::{sleep, tails};

/// Everything farther than so many times the yardstick is listed.
const FAR: f64 = 3.0;

pub(super) fn notes(scenes: &[Ways]) -> Vec<String> {
    let runs = || scenes.iter().flat_map(|ways| ways.pbig());
    let (compared, needed) =
        runs().fold((0, 0), |(steps, pairs), run| (steps + run.compared, pairs + run.reported.needed));
    let mut notes = vec![
        format!(
            "Each scene with rapier's own broad phase (stock), with pbig's, with pbig's without a margin, and {PERMUTED} \
             times with stock and the bodies inserted in another order. These are the control: as far as they are from \
             stock, a run says nothing about who found the pairs. Rapier solves contacts in an order that comes from that of \
             the broad phase's events. Ours come sorted by colliders; so in one run more (sorted) stock's events are sorted as \
             ours are. And in a pair it counts which collider is the first: in one run of ours it is, as with stock, the one of the \
             lower index (lower first), else the one with fewer pairs. What f32 itself does to a world is in the study before \
             this one, where the same world in f64 is the truth. All in turn, step by step. Contacts and points are \
             means over the second half of the run; penetration and momentum are of the whole run, energy is in % of that \
             after the first step. At rest: less than 1 mJ for each kg from there to the end; \"not within\" so many steps: \
             not in this run. The cloud has no gravity, no ground and no sleep: what it loses of momentum is error. In the \
             chart stock at 0 is the run that all are held against; the others of that colour are those again, permuted and sorted."
        ),
        format!(
            "Pairs that overlap and that pbig does not report: none of {needed}, in {compared} steps (brute force)."
        ),
    ];
    notes.extend(WAYS.iter().filter_map(|way| again(scenes, way.name)));
    notes.extend(scenes.iter().map(first_difference));
    notes.extend([rests(scenes), sleep::note(scenes)]);
    notes.extend([distances_at_the_end(scenes), tails::note(scenes), how_far(scenes)]);
    notes
}

/// Which scenes come to rest, and what moves at the end in those that do not.
fn rests(scenes: &[Ways]) -> String {
    let of = |ways: &Ways| {
        let Figures { rest, steps, moving: Moving { bodies, moving, round }, .. } = ways.first();
        match rest {
            Some(step) => format!("{} from step {step} on", ways.scene),
            None => format!(
                "{} not within {steps} steps: at the end {moving} of {bodies} bodies have more than 1 mJ for each kg, {round} \
                 of these with a shape that rolls",
                ways.scene
            ),
        }
    };
    format!(
        "At rest, with stock: {}. Rapier has no rolling friction: a ball on level ground rolls on, and a world with one is at \
         rest only when it has hit what stops it. In the cloud nothing stops bodies but other bodies.",
        scenes.iter().map(of).collect::<Vec<_>>().join("; ")
    )
}

/// Mean distances at the end as multiples of the farthest permuted run's, way by way.
fn distances_at_the_end(scenes: &[Ways]) -> String {
    let of = |name: &str| {
        let times = times_at_the_end(scenes, name);
        let mean = geometric_mean(&times).map(|mean| format!("{mean:.2} times"));
        let parts: Vec<String> = mean.into_iter().chain(without_mean(&times)).collect();
        format!("{name} {}", parts.join(", "))
    };
    let ways = WAYS.iter().filter(|way| way.is_held_against_stock());
    let all: Vec<String> = ways.map(|way| of(way.name)).collect();
    format!(
        "At the end bodies are as far from stock's as those of the farthest permuted run (geometric means over \
         scenes): {}.",
        all.join("; ")
    )
}

/// Scene by scene: 0 where a way's bodies end where stock's do, infinity where those of no permuted run end elsewhere.
fn times_at_the_end(scenes: &[Ways], way: &str) -> Vec<f64> {
    let times = |ways: &Ways| {
        let run = ways.runs.iter().find(|run| run.way == way)?;
        multiple(run, ways.first(), &ways.yardsticks(), DISTANCE)?.times
    };
    scenes.iter().filter_map(times).collect()
}

/// Of those that have a logarithm.
fn geometric_mean(times: &[f64]) -> Option<f64> {
    let logarithms: Vec<f64> = times.iter().map(|times| times.ln()).filter(|ln| ln.is_finite()).collect();
    (!logarithms.is_empty()).then(|| (logarithms.iter().sum::<f64>() / logarithms.len() as f64).exp())
}

/// The others, in words.
fn without_mean(times: &[f64]) -> impl Iterator<Item = String> {
    let kinds = [("not at all", 0.0), ("where no permuted one moves", f64::INFINITY)];
    let told = kinds.map(|(what, value)| Some(format!("{what} in {}", scenes_with(value, times)?)));
    told.into_iter().flatten()
}

/// Counts the scenes with just this multiple; none if there is no such scene.
fn scenes_with(value: f64, times: &[f64]) -> Option<String> {
    match times.iter().filter(|times| **times == value).count() {
        0 => None,
        1 => Some("1 scene".to_owned()),
        some => Some(format!("{some} scenes")),
    }
}

/// Compares the two runs of a way that was run twice.
fn again(scenes: &[Ways], way: &str) -> Option<String> {
    let mut others = Vec::new();
    for Ways { scene, repeats, .. } in scenes {
        let (_, differs) = repeats.iter().find(|(name, _)| *name == way)?;
        others.extend(differs.map(|step| format!("{scene} from step {step}")));
    }
    if others.is_empty() {
        return Some(format!("Two runs with {way} are the same, to the bit of every pose, in every scene."));
    }
    Some(format!("Two runs with {way} differ ({}).", others.join(", ")))
}

fn first_difference(ways: &Ways) -> String {
    let yardsticks = ways.yardsticks();
    let permuted = yardsticks.iter().filter_map(|run| run.differs).min();
    let told = |name: &str, differs: Option<usize>| match differs {
        None => format!("{name} gives stock's positions to the bit, to the end"),
        Some(step) => format!("{name} differs from stock from step {step}"),
    };
    let held = ways.held().map(|run| told(run.way, run.differs));
    let all: Vec<String> = [told("a permuted stock", permuted)].into_iter().chain(held).collect();
    format!("{}: {}.", ways.scene, all.join("; "))
}

/// Every quantity in which a run is farther from stock than permuted runs by more than [`FAR`], or the worst one.
fn how_far(scenes: &[Ways]) -> String {
    let mut all: Vec<(f64, String)> = Vec::new();
    for ways in scenes {
        for run in ways.held() {
            let told = |(quantity, found): (&str, Multiple)| {
                Some((found.times?, told(ways.scene, run.way, quantity, &found)))
            };
            all.extend(ways.multiples(run).filter_map(told));
        }
    }
    all.sort_by(|a, b| b.0.total_cmp(&a.0));
    let (count, far) = (all.len(), all.iter().take_while(|one| one.0 > FAR));
    let far: Vec<&str> = far.map(|one| one.1.as_str()).collect();
    if far.is_empty() {
        let worst = all.first().map_or("nothing", |one| one.1.as_str());
        return format!(
            "In no quantity is a run more than {FAR} times as far from stock as a stock with another order is: at \
             most {worst}."
        );
    }
    format!(
        "All in which a run is more than {FAR} times as far from stock as the farthest of the stock runs with \
         another order, {} of {count} quantities: {}.",
        far.len(),
        far.join("; ")
    )
}

fn told(scene: &str, way: &str, quantity: &str, Multiple { times, values, nearer, .. }: &Multiple) -> String {
    let [here, stock, permuted] = values.map(plain);
    let times = match times {
        Some(times) if times.is_finite() => format!("{times:.2} times"),
        _ => "no permuted run differs".into(),
    };
    format!(
        "{quantity} of {scene} with {way}, {here} where stock has {stock} and a permuted one {permuted} ({times}, {nearer} \
         of the permuted ones nearer)"
    )
}

#[cfg(test)]
mod tests {
    use super::super::figures::tests::nothing;
    use super::super::sides;
    use super::*;

    /// Stock with 100 contacts, the permuted runs with 110, pbig with these.
    fn made(pbig: f64) -> Vec<Ways> {
        let contacts = |way: &sides::Way| match (way.is_pbig(), way.is_permuted()) {
            (true, _) => pbig,
            (_, true) => 110.0,
            _ => 100.0,
        };
        let run = |way| Figures { contacts: contacts(way), way: way.name, ..nothing() };
        let repeats = vec![("stock", None), ("pbig", None)];
        vec![Ways { scene: "column", runs: WAYS.iter().map(run).collect(), instants: vec![], repeats }]
    }

    #[test]
    fn what_is_far_is_named_and_else_the_worst() {
        let near = how_far(&made(130.0));
        let worst =
            "with pbig lower first, 130.0 where stock has 100.0 and a permuted one 110.0 (3.00 times, ";
        assert!(near.contains("at most contacts of column") && near.contains(worst), "{near}");
        // Just beyond: pbig, with lower first and without a margin, in contacts and nothing else of eight quantities; sorted in none.
        let far = how_far(&made(131.0));
        assert!(far.starts_with("All in which a run is more than 3 times"), "{far}");
        assert!(
            far.contains(", 3 of 32 quantities") && far.matches("(3.10 times, 19 of").count() == 3,
            "{far}"
        );
    }

    #[test]
    fn distances_at_the_end_are_told_as_multiples_of_the_farthest_permuted() {
        let with = |scene: &'static str, pbig: f64| {
            let mut ways = made(100.0).remove(0);
            ways.scene = scene;
            for (way, run) in WAYS.iter().zip(&mut ways.runs) {
                run.apart.mean = if way.is_pbig() { pbig } else { f64::from(u8::from(way.is_permuted())) };
            }
            ways
        };
        let told = distances_at_the_end(&[with("near", 0.5), with("far", 8.0)]);
        let none = "stock sorted not at all in 2 scenes; pbig lower first 2.00 times; pbig 2.00 times; ";
        assert!(told.ends_with(&format!(": {none}pbig without margin 2.00 times.")), "{told}");
        let told = distances_at_the_end(&[with("near", 0.5), with("far", 8.0), with("same", 0.0)]);
        assert!(told.contains("; pbig 2.00 times, not at all in 1 scene; "), "{told}");
        let mut alone = with("alone", 1.0);
        WAYS.iter()
            .zip(&mut alone.runs)
            .filter(|(way, _)| way.is_permuted())
            .for_each(|(_, run)| run.apart.mean = 0.0);
        let told = distances_at_the_end(&[alone]);
        assert!(told.contains("; pbig where no permuted one moves in 1 scene; "), "{told}");
    }

    #[test]
    fn what_keeps_a_scene_from_rest_is_told() {
        let mut scenes = made(100.0);
        scenes[0].runs[0].moving = Moving { bodies: 9, moving: 4, round: 3 };
        let told = rests(&scenes);
        assert!(told.contains("column not within 100 steps: at the end 4 of 9 bodies have more"), "{told}");
        assert!(told.contains("3 of these with a shape that rolls"), "{told}");
        scenes[0].runs[0].rest = Some(7);
        assert!(rests(&scenes).contains("column from step 7 on"), "{}", rests(&scenes));
    }

    #[test]
    fn runs_that_do_not_differ_are_said_to_be_the_same() {
        let mut scenes = made(100.0);
        let told = again(&scenes, "pbig").unwrap_or_default();
        assert!(told.contains("with pbig are the same, to the bit"), "{told}");
        assert_eq!(again(&scenes, "stock permuted"), None);
        let told = first_difference(&scenes[0]);
        assert_eq!(told.matches("to the bit, to the end").count(), 5, "{told}");
        scenes[0].repeats[0].1 = Some(7);
        scenes[0].runs[3].differs = Some(9);
        scenes[0].runs[2].differs = Some(8);
        let told = again(&scenes, "stock").unwrap_or_default();
        assert!(told.ends_with("differ (column from step 7)."), "{told}");
        let told = first_difference(&scenes[0]);
        assert!(told.starts_with("column: a permuted stock differs from stock from step 8;"), "{told}");
    }
}
