//! Where runs stand among the permuted ones, over all quantities of all scenes: one that differs from stock by the order
//! of insertion alone is seldom the farthest of all, or the nearest.

use super::Ways;
use super::figures::{Multiple, QUANTITIES, multiple};
use super::sides::{SORTED, WAYS, Way};

/// A quantity of a scene.
type Named = (&'static str, &'static str);

/// Where a run is farther from stock than all others of some, and where nearer.
#[derive(Clone, Debug, Default, PartialEq)]
struct Tails {
    farther: Vec<Named>,
    nearer: usize,
    /// Quantities that count: they have a meaning, and not all these runs are as far from stock.
    all: usize,
}

impl Tails {
    /// Of the way in a place, among the ways in others.
    fn of(scenes: &[Ways], place: usize, others: &[usize]) -> Self {
        let mut tails = Self::default();
        for ways in scenes {
            let others: Vec<_> = others.iter().map(|&other| &ways.runs[other]).collect();
            for quantity in QUANTITIES {
                let found = multiple(&ways.runs[place], ways.first(), &others, quantity);
                let Some(found) = found.filter(|found| found.times.is_some() && !found.is_tied) else {
                    continue;
                };
                tails.count((ways.scene, quantity.name), &found, others.len());
            }
        }
        tails
    }

    fn count(&mut self, name: Named, found: &Multiple, others: usize) {
        self.all += 1;
        self.nearer += usize::from(found.farther == others);
        if found.nearer == others {
            self.farther.push(name);
        }
    }

    fn told(&self, name: &str) -> String {
        format!("{name} {} and {} of {}", self.farther.len(), self.nearer, self.all)
    }
}

fn places(wanted: fn(&Way) -> bool) -> Vec<usize> {
    (0..WAYS.len()).filter(|&place| wanted(&WAYS[place])).collect()
}

/// Each permuted run among the others.
fn of_permuted(scenes: &[Ways]) -> Vec<Tails> {
    let permuted = places(Way::is_permuted);
    let one = |&place: &usize| {
        let others: Vec<usize> = permuted.iter().copied().filter(|&other| other != place).collect();
        Tails::of(scenes, place, &others)
    };
    permuted.iter().map(one).collect()
}

/// How often runs are the farthest or the nearest of all, beside how often permuted ones are.
pub(super) fn note(scenes: &[Ways]) -> String {
    let permuted = places(Way::is_permuted);
    let held: Vec<(&str, Tails)> = places(Way::is_held_against_stock)
        .into_iter()
        .map(|place| (WAYS[place].name, Tails::of(scenes, place, &permuted)))
        .collect();
    let control = of_permuted(scenes);
    let most = |of: fn(&Tails) -> usize| control.iter().map(of).max().unwrap_or(0);
    let told: Vec<String> = held.iter().map(|(name, tails)| tails.told(name)).collect();
    format!(
        "In how many quantities a run is farther from this run of stock than all {} permuted ones, and in how many nearer than \
         all: {}. Each permuted run among the others is so in up to {} and {}. {} Quantities of one scene depend on each \
         other, and those in which all these runs are as far from stock do not count; in the last table is the percent of \
         permuted runs that are nearer.",
        permuted.len(),
        told.join("; "),
        most(|tails| tails.farther.len()),
        most(|tails| tails.nearer),
        verdict(&held, most(|tails| tails.farther.len()), scenes)
    )
}

/// Whether pbig is farther more often than any permuted run is, and where our order of events does as much.
fn verdict(held: &[(&str, Tails)], most: usize, scenes: &[Ways]) -> String {
    let of =
        |wanted: &str| held.iter().find(|(name, _)| *name == wanted).map(|(_, tails)| &tails.farther[..]);
    let (ours, sorted) = (of("pbig").unwrap_or_default(), of(SORTED).unwrap_or_default());
    if ours.len() <= most {
        return "So pbig is not farther from stock more often than orders of insertion are.".to_owned();
    }
    let is_caused = |scene: &str| scenes.iter().any(|ways| ways.scene == scene && ways.stock_repeats());
    let (shared, others): (Vec<Named>, Vec<Named>) =
        ours.iter().partition(|named| sorted.contains(named) && is_caused(named.0));
    format!(
        "So pbig is farther more often than any of them: in {} where stock sorted is, too, and stock repeats itself to the \
         bit, so that the order of events alone does it; else in {}.",
        listed(&shared),
        listed(&others)
    )
}

fn listed(all: &[Named]) -> String {
    let named: Vec<String> = all.iter().map(|(scene, quantity)| format!("{quantity} of {scene}")).collect();
    if named.is_empty() { "none".to_owned() } else { named.join(", ") }
}

#[cfg(test)]
mod tests {
    use super::super::figures::{Figures, tests::nothing};
    use super::super::sides::PERMUTED;
    use super::*;

    /// Stock has 100 contacts, permuted runs from 101 on, each scene in another order, sorted and pbig these.
    fn made(scene: &'static str, sorted: f64, pbig: f64) -> Ways {
        let contacts = |place: usize| match &WAYS[place] {
            way if way.is_pbig() => pbig,
            way if way.is_permuted() => 101.0 + ((place + scene.len()) % PERMUTED) as f64,
            way if way.name == SORTED => sorted,
            _ => 100.0,
        };
        let run = |place: usize| Figures { contacts: contacts(place), way: WAYS[place].name, ..nothing() };
        let repeats = vec![("stock", None)];
        Ways { scene, runs: (0..WAYS.len()).map(run).collect(), instants: vec![], repeats }
    }

    #[test]
    fn the_farthest_and_the_nearest_are_counted() {
        let permuted = places(Way::is_permuted);
        let of = |pbig| {
            let place = WAYS.iter().position(Way::is_pbig).expect("a way");
            Tails::of(&[made("column", 100.0, pbig)], place, &permuted)
        };
        let farther = vec![("column", "contacts")];
        assert_eq!(of(200.0), Tails { farther, nearer: 0, all: 1 });
        assert_eq!(of(105.0), Tails { farther: vec![], nearer: 0, all: 1 });
        assert_eq!(of(100.5), Tails { farther: vec![], nearer: 1, all: 1 });
    }

    #[test]
    fn of_the_permuted_runs_one_is_the_farthest_in_each_quantity() {
        let all = of_permuted(&[made("column", 100.0, 100.0), made("pile", 100.0, 100.0)]);
        let counts =
            |of: fn(&Tails) -> usize| all.iter().map(of).filter(|count| *count > 0).collect::<Vec<_>>();
        assert_eq!(counts(|tails| tails.farther.len()), [1, 1], "each scene has another");
        assert_eq!(counts(|tails| tails.nearer), [1, 1]);
    }

    #[test]
    fn the_verdict_names_what_the_order_of_events_does() {
        let scenes =
            [made("column", 300.0, 300.0), made("pile", 300.0, 300.0), made("pyramid", 100.0, 300.0)];
        let told = note(&scenes[1..2]);
        assert!(told.contains("So pbig is not farther from stock more often"), "{told}");
        let told = note(&scenes);
        assert!(told.contains("stock sorted 2 and 1 of 3; pbig 3 and 0 of 3"), "{told}");
        assert!(
            told.contains("in contacts of column, contacts of pile where stock sorted is, too"),
            "{told}"
        );
        assert!(told.contains("else in contacts of pyramid."), "{told}");
        let mut scenes = scenes;
        scenes[0].repeats = vec![("stock", Some(3))];
        let told = note(&scenes);
        assert!(
            told.contains("in contacts of pile where") && told.contains("else in contacts of column, "),
            "{told}"
        );
    }
}
