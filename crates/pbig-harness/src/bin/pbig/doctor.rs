//! `pbig doctor`: what this machine offers, what is chosen and why, and a self-test.

use crate::output::{Failure, print};
use pbig_core::{Backend, Config, Finder, Limits, Strategy, oracle};
use pbig_harness::boxes::BoxSet;

pub(crate) fn run() -> Result<(), Failure> {
    let Limits { max_boxes, max_pairs } = Limits::DEFAULT;
    print(&format!(
        "pbig {}\n\
         adapters: none; this build has no GPU backend\n\
         CPU: {} threads, SIMD found: {}; SIMD used: the compiler's baseline\n\
         limits: {max_boxes} boxes, {max_pairs} pairs (pbig_core::Limits)\n\
         backend: cpu, because there is no adapter to compare with; below {} boxes without a grid\n\
         self-test:",
        env!("CARGO_PKG_VERSION"),
        rayon::current_num_threads(),
        simd_found().join(" "),
        Config::DEFAULT.brute_below,
    ))?;
    self_test()
}

/// Every strategy on every set against the oracle.
fn self_test() -> Result<(), Failure> {
    let mut wrong = Vec::new();
    for (name, backend, strategy) in [
        ("grid", Backend::Cpu, Strategy::Grid),
        ("pbig grid", Backend::Cpu, Strategy::Pbig),
        ("brute", Backend::Brute, Strategy::Auto),
    ] {
        let mut finder = Finder::new(Config { backend, strategy, ..Config::DEFAULT });
        for set in BoxSet::ALL {
            let boxes = set.boxes(2000, 1);
            let right = finder.find(&boxes).is_ok_and(|found| found == oracle::pairs(&boxes));
            let verdict = if right { "ok" } else { "WRONG" };
            print(&format!("  {name:<9} {:<10} {verdict}", set.name))?;
            if !right {
                wrong.push(format!("{name} on {}", set.name));
            }
        }
    }
    if wrong.is_empty() {
        Ok(())
    } else {
        Err(Failure::Check(format!("self-test failed: {}", wrong.join(", "))))
    }
}

#[cfg(target_arch = "x86_64")]
fn simd_found() -> Vec<&'static str> {
    let found = [
        ("sse4.2", is_x86_feature_detected!("sse4.2")),
        ("avx2", is_x86_feature_detected!("avx2")),
        ("fma", is_x86_feature_detected!("fma")),
        ("avx512f", is_x86_feature_detected!("avx512f")),
    ];
    found.into_iter().filter(|(_, has)| *has).map(|(name, _)| name).collect()
}

#[cfg(not(target_arch = "x86_64"))]
fn simd_found() -> Vec<&'static str> {
    vec![std::env::consts::ARCH]
}
