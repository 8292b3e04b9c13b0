//! Every scene through rapier, ours beside stock in the same world.

use super::case::{Case, OURS, Side, Wanted};
use crate::bench::measure::Effort;
use crate::bench::step::Duel;
use crate::output::progress;
use pbig_harness::scenes::Scene;
use std::time::Duration;

const STOCK: &str = "stock";

pub(super) fn run(sizes: &[usize], quick: bool) -> Vec<Case> {
    let (rounds, ms) = if quick { (40, 50) } else { (300, 10_000) };
    let effort = Effort { warm_up: 0, rounds, budget: Duration::from_millis(ms) };
    let bar = progress(Scene::ALL.len() * sizes.len(), "scenes");
    let mut cases = vec![];
    for &bodies in sizes {
        for scene in Scene::ALL {
            cases.push(case(scene, bodies, effort));
            bar.inc(1);
        }
    }
    bar.finish_and_clear();
    cases
}

fn case(scene: Scene, bodies: usize, effort: Effort) -> Case {
    let duel = Duel::run(scene, bodies, effort);
    let side =
        |k: usize, what, threads| Side { what, threads, ms: duel.times.iter().map(|ms| ms[k]).collect() };
    let threads = rayon::current_num_threads();
    let wanted = Wanted { faster: Some((STOCK, 1.0)), ..Wanted::default() };
    let sides = vec![side(0, OURS, threads), side(1, STOCK, threads)];
    Case { motion: scene.name, density: "scene", boxes: bodies, pairs: duel.pairs(), sides, wanted }
}
