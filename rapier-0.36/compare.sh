#!/usr/bin/env bash
# Holds the patched rapier 0.36.1 against the unpatched one:
#   rapier-0.36/compare.sh stock [BODIES] [STEPS]
#       (400 and 120) without a finder every scene is the same, bit by bit: poses, and the saved bytes of the broad phase; a few
#       minutes
#   rapier-0.36/compare.sh tests [ARGUMENTS OF cargo test]
#       rapier's own tests, without and with pbig in every broad phase; with arguments PBIG_EXPECTED names the tests that fail
#       with pbig
set -euo pipefail
cd "$(dirname "$0")/.."
. scripts/common.sh
root=$PWD
folder=$(target_folder)/rapier

# project NAME TEXT: a project of its own, whose Cargo.toml ends with the text.
project() {
    mkdir -p "$folder/$1/src"
    cat >"$folder/$1/Cargo.toml" <<TOML
[package]
name = "fingerprint"
version = "0.0.0"
edition = "2024"
[dependencies]
glam = { version = "0.34", features = ["libm"] }
postcard = { version = "1.1", default-features = false, features = ["use-std"] }
pbig-scenes = { path = "$root/crates/pbig-scenes", default-features = false }
rapier = { package = "rapier3d", version = "=0.36.1", features = ["serde-serialize"] }
[workspace]
$2
TOML
    cat >"$folder/$1/src/main.rs" <<RUST
//! Prints a hash of each scene's poses and of its broad phase's bytes.
#![allow(dead_code)]
#[path = "$root/rapier-0.36/harness/src/build.rs"]
mod build;
#[path = "$root/rapier-0.36/harness/src/three.rs"]
mod dimension;
#[path = "$root/rapier-0.36/harness/src/world.rs"]
mod world;

use pbig_scenes::scenes::Scene;
use rapier::prelude::BroadPhaseBvh;
use std::hash::{DefaultHasher, Hash, Hasher};

fn main() {
    for scene in Scene::ALL {
        let mut world = build::world_of(&scene.plan($bodies, 1), BroadPhaseBvh::new());
        let mut hash = DefaultHasher::new();
        for step in 0..$steps {
            world.step();
            world::pose_bits(&world).hash(&mut hash);
            if step % 20 == 0 {
                postcard::to_stdvec(&world.broad_phase).expect("bytes").hash(&mut hash);
            }
        }
        println!("{} {:016x}", scene.name, hash.finish());
    }
}
RUST
    cargo run --quiet --release --manifest-path "$folder/$1/Cargo.toml" --target-dir "$folder/$1/target" >"$folder/$1.txt"
}

run_stock() {
    local bodies=${1:-400} steps=${2:-120}
    project unpatched ""
    project patched "[patch.crates-io]
rapier3d = { path = \"$root/rapier-0.36/patched/rapier3d-0.36.1\" }"
    [ -s "$folder/unpatched.txt" ] || { echo "no scene was run" >&2 && exit 1; }
    diff "$folder/unpatched.txt" "$folder/patched.txt" || { echo "the patched rapier differs" >&2 && exit 1; }
    echo "$(wc -l <"$folder/patched.txt") scenes with $bodies bodies: the same after each of $steps steps"
}

# edit FILE COMMAND: edits a file in place. Not every sed has -i without a suffix, nor \n for a new line.
edit() {
    sed "$2" "$copy/src/$1" >"$copy/edited"
    mv "$copy/edited" "$copy/src/$1"
}

# make_copy: a copy of rapier that contains rapier-pbig as a module, because a crate's unit tests cannot use a crate that depends on
# it. The variable RAPIER_PBIG installs the finder in every new broad phase.
make_copy() {
    rm -rf "$copy"
    mkdir -p "$copy/src/pbig"
    cp -r rapier-0.36/patched/rapier3d-0.36.1/. "$copy"
    # Its `crate::` is `crate::pbig::` here.
    for file in config finder scene tree; do
        { sed 's/crate::/crate::pbig::/g; s/use rapier::/use crate::/' "rapier-0.36/rapier3d-pbig/src/$file.rs"
          echo '#[allow(unused_imports)] use std::prelude::rust_2024::*;'
        } >"$copy/src/pbig/$file.rs"
    done
    cat >"$copy/src/pbig/mod.rs" <<'RUST'
#![allow(missing_docs, dead_code)]
mod config;
mod finder;
mod scene;
mod tree;
pub(crate) use config::PbigConfig;
pub(crate) use finder::PbigFinder;
use crate::geometry::{PairFinder, SceneQuery};
const MARGIN: f32 = 0.04;
const MAX_ADAPTIVE_MARGIN: f32 = 0.25;
type Bounds = <crate::math::Real as pbig_adapter::Scalar>::Aabb;

fn to_f32(x: crate::math::Real) -> f32 {
    x
}

pub(crate) fn wanted() -> Option<std::boxed::Box<dyn PairFinder>> {
    std::env::var_os("RAPIER_PBIG").map(|_| std::boxed::Box::<PbigFinder>::default() as _)
}
RUST
    edit lib.rs 's/^pub mod control;/pub(crate) mod pbig; pub mod control;/'
    edit geometry/broad_phase_bvh/mod.rs \
        '/pub fn new() -> Self {/{n;s/Self::default()/Self { pair_finder: crate::pbig::wanted(), ..Self::default() }/;}'
    edit pipeline/physics_world.rs 's/DefaultBroadPhase::default()/DefaultBroadPhase::new()/'
    cat >>"$copy/Cargo.toml" <<TOML

[dependencies.pbig-core]
path = "$root/crates/pbig-core"
default-features = false
[dependencies.pbig-adapter]
path = "$root/crates/pbig-adapter"
default-features = false
[dependencies.tracing]
version = "0.1"
default-features = false
features = ["std"]

[workspace]
TOML
    grep -q 'pbig::wanted' "$copy/src/geometry/broad_phase_bvh/mod.rs" || { echo "the finder is not installed" >&2; exit 1; }
}

# run_tests_once LOG: runs the tests, and prints those that failed, in order.
run_tests_once() {
    cargo test --no-fail-fast --features serde-serialize "${arguments[@]}" >"$1" 2>&1 || true
    if ! grep -qa '^test result' "$1" || grep -qa '(signal: ' "$1"; then tail "$1" >&2 && exit 1; fi
    grep -aE '^test .* \.\.\. FAILED' "$1" | cut -d' ' -f2 | LC_ALL=C sort | paste -sd' ' -
    grep -ahE '^test result' "$1" | awk '{ passed += $4; failed += $6 } END { print passed " passed, " failed " failed" }' >&2
}

# default_tests: prints the tests that run without arguments: unit tests, and those of tests/ that simulate neither soft bodies nor
# joints for long, which takes an hour in a debug build.
default_tests() {
    local file name
    echo --lib
    for file in "$copy"/tests/*.rs; do
        name=$(basename "$file" .rs)
        case $name in soft_* | fem_* | joint_stability | *prismatic*) ;; *) echo "--test $name" ;; esac
    done
}

# The tests that fail with pbig, each explained in docs/DROP_IN.md.
expected="awake_pile capsule_on_trimesh_falls_asleep ccd_bodies \
geometry::narrow_phase::test::collider_set_parent_no_self_intersection joints_and_sensor \
multibody_articulation restoring_into_a_live_pipeline sleeping_pile structural_changes"

run_tests() {
    local copy=$folder/rapier3d failed arguments=("$@")
    make_copy
    if [ $# -eq 0 ]; then arguments=($(default_tests)); else expected=${PBIG_EXPECTED:-}; fi
    cd "$copy"
    export CARGO_TARGET_DIR=$folder/target
    echo "== rapier's tests without a finder"
    failed=$(run_tests_once "$folder/stock.log")
    [ -z "$failed" ] || { echo "failed: $failed" && exit 1; }
    echo "== rapier's tests with pbig"
    failed=$(RAPIER_PBIG=1 run_tests_once "$folder/pbig.log")
    [ "$failed" = "$expected" ] || { echo "failed: $failed; expected: $expected" && exit 1; }
    echo "== as expected"
}

case ${1:-} in
stock | tests)
    scripts/patch-rapier.sh rapier-0.36 >/dev/null
    "run_$1" "${@:2}"
    ;;
*) sed -n '2,/^set/s/^# \{0,1\}//p' "$0" >&2 && exit 2 ;;
esac
