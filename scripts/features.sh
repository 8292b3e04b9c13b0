#!/usr/bin/env bash
# Tests with other features than the rest of the tests has:
#   scripts/features.sh [KIND...]     without a kind: none parallel simd deterministic
# none, parallel, simd, deterministic: all that depends on rapier, with this feature of rapier alone beside its serde-serialize
#   (parallel, simd-stable and enhanced-determinism in rapier; scripts/test.sh tests the first two together).
# powerset: lints rapier-pbig, and the crates of this workspace that it depends on, with every set of its features.
# powerset-0.36: the same for rapier-pbig of rapier 0.36.
set -euo pipefail
cd "$(dirname "$0")/.."
. scripts/common.sh

# sets FEATURE...: prints every set of the features, one a line, separated by commas.
sets() {
    [ $# -gt 0 ] || { echo && return; }
    local first=$1 set
    shift
    sets "$@" | while read -r set; do
        echo "$set"
        echo "$first${set:+,$set}"
    done
}

# lint PACKAGE OPTIONS FEATURE...: lints a package, and its dependencies of the workspace, with every set of the features.
lint() {
    local package=$1 options=$2 set
    shift 2
    sets "$@" | while read -r set; do
        echo "== $package with '$set'"
        # Not quoted: several words, or none.
        cargo clippy --quiet --locked --release $options -p "$package" --no-default-features --features "$set" -- -D warnings \
            </dev/null
    done
}

# test_with FEATURE: the bits of a world whatever the threads, and everything in which rapier takes part.
test_with() {
    echo "== rapier with $1"
    local feature=$1
    [ "$feature" != none ] || feature=
    cargo test --locked --release -p pbig-tests --no-default-features --features "$feature" --test suite -- \
        calls drop_in upstream shapes restore queries explain random_worlds worlds::the_same
}

[ $# -gt 0 ] || set -- none parallel simd deterministic
for kind in "$@"; do
    case $kind in
    powerset)
        lint rapier-pbig "" parallel gpu serde debug-render shadow
        lint pbig-gpu "" wgpu
        ;;
    powerset-0.36) lint rapier-pbig "--manifest-path rapier-0.36/Cargo.toml" parallel gpu debug-render shadow ;;
    *) test_with "$kind" ;;
    esac
done
