#!/usr/bin/env bash
# Builds and tests the viewer, a workspace of its own that `scripts/test.sh` does not touch:
#   scripts/viewer.sh [--no-setup]     it calls setup.sh first, unless told not to
# The tests open a window under Xvfb, press each key, and leave screenshots in viewer/out. A software adapter will do.
set -euo pipefail
cd "$(dirname "$0")/.."
[ "${1:-}" = --no-setup ] || scripts/setup.sh rust vulkan viewer || true
. scripts/common.sh

has_vulkan_loader() {
    case $(ldconfig -p 2>/dev/null) in *libvulkan.so.1*) ;; *) return 1 ;; esac
}

{ has Xvfb && has xdotool && has_vulkan_loader; } || { left_out "the viewer" && exit 0; }
started=$SECONDS
in_viewer="--manifest-path viewer/Cargo.toml"
step cargo fmt $in_viewer --check
step cargo build --locked --release $in_viewer --bins --examples
built=$SECONDS
step cargo test --locked --release $in_viewer -- --include-ignored
tested=$SECONDS
step cargo clippy --locked --release $in_viewer --all-targets -- -D warnings
echo "== viewer: all passed; build $((built - started)) s, tests $((tested - built)) s, lints $((SECONDS - tested)) s"
