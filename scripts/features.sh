#!/usr/bin/env bash
# Tests all that depends on rapier with one of rapier's features alone, beside its serde-serialize, which the tests need:
#   scripts/features.sh [none] [parallel] [simd] [deterministic]     without an argument: all four
# (parallel, simd-stable and enhanced-determinism in rapier; scripts/test.sh tests the first two together.)
set -euo pipefail
cd "$(dirname "$0")/.."
[ $# -gt 0 ] || set -- none parallel simd deterministic
for feature in "$@"; do
    echo "== rapier with $feature"
    features=$feature
    [ "$feature" != none ] || features=
    # The bits of a world whatever the threads, and everything in which rapier takes part.
    cargo test --release -p pbig-tests --no-default-features --features "$features" --test suite -- \
        calls drop_in upstream shapes restore queries explain random_worlds worlds::the_same
done
