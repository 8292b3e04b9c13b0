#!/usr/bin/env bash
# The one test command. It sets the machine up, runs named steps, and ends with a table of times and counts.
#   scripts/test.sh [--no-setup] [STEP...]     without a step: all
# setup.sh installs what is missing, if it may, and says what; --no-setup leaves it out. Without a GPU adapter (a software one
# will do) the steps that need one are left out, and the table says so. With CI=true that is a failure.
set -uo pipefail
cd "$(dirname "$0")/.."
. scripts/common.sh
. scripts/report.sh

# Planted faults leave files for `pbig replay` in the folder for temporary files.
TMPDIR=$(mktemp -d)
export TMPDIR
trap 'rm -rf "$TMPDIR" "$log"' EXIT

# Options of several words, which are not quoted where they are used.
in_036="--manifest-path rapier-0.36/Cargo.toml"
members_036="-p rapier-pbig -p pbig-harness-036"
features_036="--features rapier-pbig/debug-render"
# The suite refuses to leave the GPU out with CI=true.
without_gpu="env -u CI PBIG_GPU=none"
gpu=''

# has_gpu: the program finds an adapter.
has_gpu() {
    [ -n "$gpu" ] || case $(cargo run --quiet --release --bin pbig -- doctor 2>&1) in
    *"adapters: none"*) gpu=false ;;
    *) gpu=true ;;
    esac
    $gpu
}

# lacks PACKAGE CRATE [OPTION...]: fails if the package depends on the crate.
lacks() {
    local package=$1 crate=$2 tree
    shift 2
    tree=$(cargo tree --package "$package" --edges normal --prefix none "$@") || return 1
    case $'\n'$tree in *$'\n'"$crate v"*) echo "$package pulls in $crate" && return 1 ;; esac
}

# without_harness: prints options that leave out the crates that measure and run scenes, if there is no adapter: they are
# tested on every backend. They are the unpublished ones but for pbig-scenes, which uses no GPU.
without_harness() {
    local manifest
    ! has_gpu || return 0
    for manifest in $(grep -l '^publish' crates/*/Cargo.toml lab/Cargo.toml | grep -v '^crates/pbig-scenes/'); do
        echo "--exclude $(sed -n 's/^name = "\(pbig.*\)"/\1/p' "$manifest" | head -n 1)"
    done
}

step_setup() {
    check scripts/setup.sh
    . scripts/common.sh
}

step_fmt() {
    check scripts/report-test.sh
    check cargo fmt --all --check
    # Workspaces of their own.
    for other in fuzz wasm page viewer; do
        check cargo fmt --manifest-path "$other/Cargo.toml" --check
        check cargo fetch --locked --manifest-path "$other/Cargo.toml"
    done
    check cargo fetch --locked
}

step_clippy() {
    check cargo clippy --release --workspace --all-targets -- -D warnings
    check cargo check --release --locked --manifest-path fuzz/Cargo.toml --target-dir "${CARGO_TARGET_DIR:-target}"
}

# All but the suite. One profile and one set of features: every crate is built once.
step_unit() {
    check cargo build --release --workspace --examples --bins
    check cargo test --release --workspace --exclude pbig-tests $(without_harness) --no-fail-fast
    # Once more with overflow checks and debug assertions, where there is unsafe code and index arithmetic.
    check cargo test -p pbig-core --features serde --no-fail-fast
}

step_suite_cpu() {
    check $without_gpu cargo test --release --workspace --test suite
}

step_suite_gpu() {
    has_gpu || { leave_out "there is no GPU adapter" && return; }
    check cargo test --release -p pbig-tests --no-fail-fast
}

# On docs.rs a nightly Rust labels each item with its feature. A wrapper lets this release do that, too.
step_doc() {
    printf '#!/bin/sh\nRUSTC_BOOTSTRAP=1 exec rustdoc "$@"\n' >"$TMPDIR/rustdoc"
    chmod +x "$TMPDIR/rustdoc"
    check env RUSTDOC="$TMPDIR/rustdoc" RUSTDOCFLAGS="-D warnings --cfg docsrs" \
        cargo doc --release --workspace --no-deps
}

step_features() {
    check scripts/features.sh powerset
    # Rapier's own features beside those of the suite; one of the other kind for all.
    if has_gpu; then check scripts/features.sh deterministic; else check $without_gpu scripts/features.sh deterministic; fi
}

step_packages() {
    for package in pbig-core rapier-pbig; do
        check lacks "$package" rayon --no-default-features
        check lacks "$package" wgpu
    done
    check lacks pbig-wasm rayon --manifest-path wasm/Cargo.toml
    check scripts/publish.sh
}

step_wasm() {
    check scripts/wasm.sh --no-setup
}

# The commands that the documents show, at a size that takes seconds.
step_examples() {
    check cargo run --release --example falling_objects -- --bodies 500 --steps 60
    for example in drop_in existing_app headless_test debug_render boxes_to_pairs boxes_events other_device; do
        check cargo run --release --example "$example"
    done
    check cargo run --release --bin pbig -- pairs examples/boxes.csv
    check cargo run --release --bin pbig -- replay examples/frames.npy
    check cargo run --release --bin pbig -- simulate --scene pile --check --backend gpu --bodies 1500 --steps 20
    has_gpu || { leave_out "there is no GPU adapter for own_device" && return; }
    check cargo run --release --example own_device
}

step_docs() {
    [ ! -f scripts/docs.sh ] || check scripts/docs.sh
}

# The adapter for rapier 0.36, in a workspace of its own: cargo replaces rapier there by a patched copy.
step_rapier_0_36() {
    check scripts/patch-rapier.sh rapier-0.36
    check scripts/patch-rapier-test.sh
    check cargo fetch --locked $in_036
    check cargo fmt $in_036 $members_036 --check
    check cargo clippy --release $in_036 $members_036 $features_036 --all-targets -- -D warnings
    # The viewer is tested by scripts/viewer.sh.
    check cargo fmt --manifest-path rapier-0.36/viewer/Cargo.toml --check
    check cargo fetch --locked --manifest-path rapier-0.36/viewer/Cargo.toml
    check scripts/features.sh powerset-0.36
    check cargo test --release $in_036 $members_036 $features_036 --no-fail-fast
    check cargo test --release $in_036 -p pbig-harness-036 --no-default-features --features enhanced-determinism
    check cargo run --release $in_036 -p pbig-harness-036 $features_036 --example falling_objects -- --bodies 500 --steps 60
    check env RUSTDOCFLAGS="-D warnings" \
        cargo doc --release $in_036 -p rapier-pbig --features shadow,debug-render --no-deps
}

all="setup fmt clippy unit suite-cpu suite-gpu doc features packages wasm examples docs rapier-0.36"
if [ "${1:-}" = --no-setup ]; then
    all=${all#setup }
    shift
fi
[ $# -gt 0 ] || set -- $all
for name in "$@"; do
    case " $all " in *" $name "*) ;; *) echo "there is no step '$name'; the steps: $all" >&2 && exit 2 ;; esac
done
for name in "$@"; do
    run_step "$name"
done
close_report
