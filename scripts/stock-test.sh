#!/usr/bin/env bash
# Shows that a world without a finder is the same on the patched rapier as on the unpatched one, bit by bit: all scenes, with
# their poses and the saved bytes of the broad phase at several steps.
#
#     scripts/stock-test.sh [BODIES] [STEPS]     (400 and 120; two builds of rapier, a few minutes)
set -euo pipefail
root="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
bodies="${1:-400}"
steps="${2:-120}"
"$root/scripts/patch-rapier.sh" "$root/rapier-0.36" >/dev/null
work="${CARGO_TARGET_DIR:-$root/target}/stock-test"

# project NAME TEXT: a project of its own, whose Cargo.toml ends with the text.
project() {
    mkdir -p "$work/$1/src"
    cat >"$work/$1/Cargo.toml" <<TOML
[package]
name = "fingerprint"
version = "0.0.0"
edition = "2024"
[dependencies]
glam = { version = "0.34", features = ["libm"] }
postcard = { version = "1.1", default-features = false, features = ["use-std"] }
rand = "0.10"
rapier3d = { version = "=0.36.1", features = ["serde-serialize"] }
[workspace]
$2
TOML
    cat >"$work/$1/src/main.rs" <<RUST
//! Prints a hash of each scene's poses and of its broad phase's bytes.
#[path = "$root/crates/pbig-scenes/src/scenes/mod.rs"]
pub mod scenes;
#[path = "$root/rapier-0.36/harness/src/world.rs"]
#[allow(dead_code)]
pub mod world;

use rapier3d::prelude::BroadPhaseBvh;
use std::hash::{DefaultHasher, Hash, Hasher};

fn main() {
    for scene in scenes::Scene::ALL {
        let (mut world, mut broad_phase) = (scene.build($bodies, 1), BroadPhaseBvh::new());
        let mut hash = DefaultHasher::new();
        for step in 0..$steps {
            world.step(&mut broad_phase);
            world.pose_bits().hash(&mut hash);
            if step % 20 == 0 {
                postcard::to_stdvec(&broad_phase).expect("bytes").hash(&mut hash);
            }
        }
        println!("{} {:016x}", scene.name, hash.finish());
    }
}
RUST
    cargo run --quiet --release --manifest-path "$work/$1/Cargo.toml" --target-dir "$work/$1/target" >"$work/$1.txt"
}

project unpatched ""
project patched "[patch.crates-io]
rapier3d = { path = \"$root/rapier-0.36/patched/rapier3d-0.36.1\" }"
[ -s "$work/unpatched.txt" ] || { echo "no scene was run" >&2 && exit 1; }
diff "$work/unpatched.txt" "$work/patched.txt" || { echo "the patched rapier differs" >&2 && exit 1; }
echo "$(wc -l <"$work/patched.txt") scenes with $bodies bodies: the same after each of $steps steps"
