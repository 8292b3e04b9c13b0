#!/usr/bin/env bash
# Builds, lints and tests the viewer, a workspace of its own of which `scripts/test.sh` checks only formats and lock files:
#   scripts/viewer.sh [--no-setup]     it calls setup.sh first, unless told not to
# The tests open a window under Xvfb, press each key, and leave screenshots in viewer/out. A software adapter will do.
# After `scripts/patch-rapier.sh rapier-0.36` it also tests the viewer on rapier 0.36.1, in rapier-0.36/viewer.
set -euo pipefail
cd "$(dirname "$0")/.."
[ "${1:-}" = --no-setup ] || scripts/setup.sh rust vulkan viewer || true
. scripts/common.sh

has_vulkan_loader() {
    case $(ldconfig -p 2>/dev/null) in *libvulkan.so.1*) ;; *) return 1 ;; esac
}

# test_viewer FOLDER
test_viewer() {
    local workspace="--manifest-path $1/Cargo.toml" started=$SECONDS built tested
    step cargo fmt $workspace --check
    step cargo build --locked --release $workspace --bins --examples
    built=$SECONDS
    step cargo test --locked --release $workspace -- --include-ignored
    tested=$SECONDS
    step cargo clippy --locked --release $workspace --all-targets -- -D warnings
    echo "== $1: all passed; build $((built - started)) s, tests $((tested - built)) s, lints $((SECONDS - tested)) s"
}

{ has Xvfb && has xdotool && has_vulkan_loader; } || { left_out "the viewer" && exit 0; }
test_viewer viewer
[ -d rapier-0.36/patched/rapier3d-0.36.1 ] ||
    { left_out "the viewer on rapier 0.36.1" "scripts/patch-rapier.sh rapier-0.36 makes the copy that it needs" && exit 0; }
test_viewer rapier-0.36/viewer
