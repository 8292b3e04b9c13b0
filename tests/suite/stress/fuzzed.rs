//! The checks of the fuzz targets, without instruments: on the seeds, every input that once failed, and random bytes.

use pbig_harness::checks;
use pbig_harness::counting::largest;
use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};

type Check = fn(&[u8]);

const TARGETS: [(&str, Check); 9] = [
    ("finder_against_oracle", checks::finder_against_oracle),
    ("between_against_oracle", checks::between_against_oracle),
    ("updates_against_scratch", checks::updates_against_scratch),
    ("work_is_bounded", checks::work_is_bounded),
    ("decode", checks::decode_words),
    ("npy_reader", checks::npy_reader),
    ("csv_reader", checks::csv_reader),
    ("ply_reader", checks::ply_reader),
    ("obj_reader", checks::obj_reader),
];

/// Asserts that one allocation takes at most what a search needs to begin with, and 256 bytes for each byte of the input.
fn assert_fits(largest: usize, input: &[u8]) {
    let most = (1 << 20) + 256 * input.len();
    assert!(largest <= most, "{largest} bytes at once for an input of {}", input.len());
}

#[test]
fn seeds_and_inputs_that_once_failed() {
    let mut inputs = 0;
    let all = ["seeds", "failed"].into_iter().flat_map(|kind| TARGETS.map(|target| (kind, target)));
    for (kind, (target, check)) in all {
        let folder = format!("{}/../fuzz/{kind}/{target}", env!("CARGO_MANIFEST_DIR"));
        for file in std::fs::read_dir(folder).into_iter().flatten() {
            let path = file.expect("a file").path();
            println!("{}", path.display());
            let bytes = std::fs::read(path).expect("readable");
            largest();
            check(&bytes);
            assert_fits(largest(), &bytes);
            inputs += 1;
        }
    }
    assert!(inputs >= 12, "{inputs} files below fuzz");
}

#[test]
fn random_bytes_on_every_target() {
    for (target, check) in TARGETS {
        println!("{target}");
        for seed in 0..1500 {
            let mut rng = StdRng::seed_from_u64(seed);
            let length = rng.random_range(0..600);
            // Few different values: of 256 kinds of bytes few would name the same box or id twice.
            let kinds = [256, 48, 16][seed as usize % 3];
            let bytes: Vec<u8> = (0..length).map(|_| rng.random_range(0..kinds) as u8).collect();
            largest();
            check(&bytes);
            // A recipe is a world of two thousand boxes, however short.
            if target != "work_is_bounded" {
                assert_fits(largest(), &bytes);
            }
        }
    }
}
