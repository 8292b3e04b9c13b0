#!/usr/bin/env bash
# Runs rapier 0.36.1's own tests on a patched copy, without and with pbig's finder in every broad phase.
#
#     scripts/rapier-tests.sh [ARGUMENTS OF cargo test]     (with arguments PBIG_EXPECTED names the tests that fail with pbig)
#
# The copy contains rapier-pbig as a module, because a crate's unit tests cannot use a crate that depends on it. The variable
# RAPIER_PBIG installs the finder in every new broad phase. Without arguments it runs the unit tests, and those of tests/ that
# simulate neither soft bodies nor joints for long: these take an hour in a debug build.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
root="$PWD"
. scripts/common.sh
folder="$(target_folder)/rapier-tests"
copy="$folder/rapier3d"

rm -rf "$copy"
mkdir -p "$copy"
scripts/patch-rapier.sh rapier-0.36
cp -r rapier-0.36/patched/rapier3d-0.36.1/. "$copy"

# pbig's finder as a module: its `crate::` is `crate::pbig::` here.
mkdir "$copy/src/pbig"
for file in config finder scene tree; do
    { sed 's/crate::/crate::pbig::/g; s/use rapier3d::/use crate::/' "rapier-0.36/rapier-pbig/src/$file.rs"
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

pub(crate) fn wanted() -> Option<std::boxed::Box<dyn PairFinder>> {
    std::env::var_os("RAPIER_PBIG").map(|_| std::boxed::Box::<PbigFinder>::default() as _)
}
RUST
# edit FILE COMMAND: edits a file in place. Not every sed has -i without a suffix, nor \n for a new line.
edit() {
    sed "$2" "$copy/src/$1" >"$copy/edited"
    mv "$copy/edited" "$copy/src/$1"
}
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

cd "$copy"
export CARGO_TARGET_DIR="$folder/target"
arguments=("$@")
if [ $# -eq 0 ]; then
    arguments=(--lib)
    for file in tests/*.rs; do
        name="$(basename "$file" .rs)"
        case "$name" in soft_* | fem_* | joint_stability | *prismatic*) ;; *) arguments+=(--test "$name") ;; esac
    done
fi

# The tests that fail with pbig, each explained in docs/RAPIER_VERSIONS.md.
expected="awake_pile capsule_on_trimesh_falls_asleep ccd_bodies \
geometry::narrow_phase::test::collider_set_parent_no_self_intersection joints_and_sensor \
multibody_articulation restoring_into_a_live_pipeline sleeping_pile structural_changes"
[ $# -eq 0 ] || expected="${PBIG_EXPECTED:-}"

# run LOG: runs the tests, and prints those that failed, in order.
run() {
    cargo test --no-fail-fast --features serde-serialize "${arguments[@]}" >"$1" 2>&1 || true
    if ! grep -qa '^test result' "$1" || grep -qa '(signal: ' "$1"; then tail "$1" >&2 && exit 1; fi
    grep -aE '^test .* \.\.\. FAILED' "$1" | cut -d' ' -f2 | LC_ALL=C sort | paste -sd' ' -
    grep -ahE '^test result' "$1" | awk '{ passed += $4; failed += $6 } END { print passed " passed, " failed " failed" }' >&2
}

echo "== rapier's tests without a finder"
failed=$(run "$copy/../stock.log")
[ -z "$failed" ] || { echo "failed: $failed" && exit 1; }
echo "== rapier's tests with pbig"
failed=$(RAPIER_PBIG=1 run "$copy/../pbig.log")
[ "$failed" = "$expected" ] || { echo "failed: $failed; expected: $expected" && exit 1; }
echo "== as expected"
