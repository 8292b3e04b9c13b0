#!/usr/bin/env bash
# The one test command. It sets the machine up, runs named steps, and ends with a table of times and counts.
#   scripts/test.sh [--no-setup] [STEP...]     without a step: all
# setup.sh installs what is missing, if it may, and says what; --no-setup leaves it out. A step is a function `step_NAME`, with
# `_` for `-` and `.`. It ends at its first failing command, and the other steps go on. Without a GPU adapter (a software one
# will do) the parts that need one are left out, and the table says so. With CI=true that is a failure.
set -uo pipefail
cd "$(dirname "$0")/.."
. scripts/common.sh

# Planted faults leave files for `pbig replay` in the folder for temporary files.
TMPDIR=$(mktemp -d)
export TMPDIR
trap 'rm -rf "$TMPDIR"' EXIT

# Options of several words, which are not quoted where they are used.
# One choice for lints and documents, which need the same metadata, and one set of features; extra.sh lints others. The viewer draws with
# hundreds of crates.
all_but_viewer="--workspace --exclude pbig-viewer"
in_036="--manifest-path rapier-0.36/Cargo.toml"
members_036="-p rapier3d-pbig -p pbig-harness-036"
features_036="--features rapier3d-pbig/debug-render"
# The same source for two dimensions and for f64. rapier2d-pbig brings the debug renderer of two dimensions. One has rapier's threads off,
# and its `enhanced-determinism`; the mathematics of that, in simba, are all the others' in this build.
others_036="-p rapier2d-pbig -p pbig-harness-2d -p pbig-harness-2d-f64 -p pbig-harness-3d-f64 --no-default-features --features \
rapier2d-pbig/debug-render,pbig-harness-2d/parallel,pbig-harness-2d/dim2,pbig-harness-2d-f64/enhanced-determinism,\
pbig-harness-2d-f64/dim2,pbig-harness-2d-f64/f64,pbig-harness-3d-f64/parallel,pbig-harness-3d-f64/f64"
# The suite refuses to leave the GPU out with CI=true.
without_gpu="env -u CI PBIG_GPU=none"

# has_gpu: the program finds an adapter.
has_gpu() {
    case $(cargo run --quiet --release --bin pbig -- doctor 2>&1) in *"adapters: none"*) return 1 ;; esac
}

# lacks PACKAGE CRATE [OPTION...]: fails if the package depends on the crate.
lacks() {
    local package=$1 crate=$2 tree
    shift 2
    tree=$(cargo tree --package "$package" --edges normal --prefix none "$@") || return 1
    case $'\n'$tree in *$'\n'"$crate v"*) echo "$package pulls in $crate" && return 1 ;; esac
}

# choose_units: sets `units` to the targets of the default members that the step `unit` tests: all but the suite, by patterns that leave
# `suite` out. Without an adapter the crates that measure and run scenes are left out, too: they are tested on every backend.
choose_units() {
    local name
    units=(--lib --bins --example headless_test --test '[!s]*' --test 's[!u]*')
    ! has_gpu || return 0
    units=()
    for name in $(cargo tree --depth 0 --prefix none | sed -n 's/ v.*//p'); do
        case $name in pbig-tests | pbig-harness | pbig-cli | pbig-studies) ;; *) units+=(-p "$name") ;; esac
    done
}

step_setup() {
    step scripts/setup.sh
}

step_fmt() {
    step cargo fmt --all --check
    step cargo fetch --locked
    step cargo fmt --manifest-path fuzz/Cargo.toml --check
    step cargo fetch --locked --manifest-path fuzz/Cargo.toml
}

step_clippy() {
    step cargo clippy --release $all_but_viewer --all-targets -- -D warnings
    # Nothing is linked, so any name of a library saves the build of libFuzzer.
    step env CUSTOM_LIBFUZZER_PATH="$PWD/libnone.a" cargo check --release --locked --manifest-path fuzz/Cargo.toml \
        --target-dir "$(target_folder)"
}

# All but the suite. One profile, and one choice of packages, which is one set of features: every crate is built once.
step_unit() {
    step cargo build --release --examples --bins
    local units
    choose_units
    step cargo test --release "${units[@]}" --no-fail-fast
    step cargo test --release --doc --no-fail-fast
    # Once more with overflow checks and debug assertions, where there is unsafe code and index arithmetic.
    step cargo test -p pbig-core --features serde --no-fail-fast
    step cargo test -p pbig-gpu --no-default-features --lib --no-fail-fast
}

# With an adapter each test also runs on the GPU, and the tests of the GPU itself are the next step's.
step_suite() {
    local suite="cargo test --release --test suite --no-fail-fast"
    if has_gpu; then
        step $suite -- --skip kernels:: --skip gpu::
    else
        left_out "there is no GPU adapter"
        step $without_gpu $suite
    fi
}

# The parts of gpu.sh that need packages of Debian alone: the suite's GPU part, under the validation layer where that is installed.
step_gpu() {
    has_gpu || { left_out "there is no GPU adapter" && return; }
    step scripts/gpu.sh --no-setup validation amd
}

# On docs.rs a nightly Rust labels each item with its feature. A wrapper lets this release do that, too.
step_doc() {
    printf '#!/bin/sh\nRUSTC_BOOTSTRAP=1 exec rustdoc "$@"\n' >"$TMPDIR/rustdoc"
    chmod +x "$TMPDIR/rustdoc"
    step env RUSTDOC="$TMPDIR/rustdoc" RUSTDOCFLAGS="-D warnings --cfg docsrs" \
        cargo doc --release $all_but_viewer --no-deps
}

step_features() {
    step scripts/extra.sh --no-setup features sets
}

step_packages() {
    for package in pbig-core rapier-pbig; do
        step lacks "$package" rayon --no-default-features
        step lacks "$package" wgpu
    done
    step lacks pbig-wasm rayon
    step scripts/extra.sh --no-setup publish
}

step_wasm() {
    step scripts/extra.sh --no-setup wasm
}

# The examples that no document runs (see step_docs), at a size that takes seconds.
step_examples() {
    step cargo run --release --example falling_objects -- --bodies 500 --steps 60
    for example in existing_app debug_render cloth other_device; do
        step cargo run --release --example "$example"
    done
    step cargo run --release --bin pbig -- simulate --scene pile --check --backend gpu --bodies 1500 --steps 20
    has_gpu || { left_out "there is no GPU adapter for own_device and resident" && return; }
    step cargo run --release --example own_device
    step cargo run --release --example resident
}

step_docs() {
    step scripts/docs.sh
}

# The adapters for rapier 0.36, in a workspace of its own: cargo replaces rapier there by a patched copy. One target folder: what
# both workspaces need is built once.
step_rapier_0_36() {
    export CARGO_TARGET_DIR
    CARGO_TARGET_DIR=$(target_folder)
    step scripts/patch-rapier.sh rapier-0.36
    step cargo fmt --all $in_036 --check
    # `--locked` checks the lock file without a download of bevy.
    step cargo clippy --locked --release $in_036 --all-targets --features \
        rapier2d-pbig/debug-render,rapier3d-pbig/debug-render,rapier3d-pbig/gpu -- -D warnings
    step scripts/extra.sh --no-setup features sets-0.36
    rm -f "$CARGO_TARGET_DIR/release/bench_step"
    step cargo test --release $in_036 $members_036 $features_036 --no-fail-fast
    # Built for the tests above. `cargo run` would build rapier again, for other features.
    step "$CARGO_TARGET_DIR/release/bench_step" --scenes column --bodies 500 --steps 60
    step env PBIG_RUNS=100 PBIG_BODIES=80 cargo test --release $in_036 $others_036 --no-fail-fast
    step env RUSTDOCFLAGS="-D warnings" \
        cargo doc --release $in_036 -p rapier3d-pbig --features shadow,debug-render --no-deps
    # The packages have their source, which is a link in three of them.
    for crate in rapier2d rapier2d-f64 rapier3d rapier3d-f64; do
        step cargo package --quiet --no-verify --allow-dirty --exclude-lockfile $in_036 -p "$crate-pbig"
    done
}

# count LOG STATUS: prints how many tests passed, failed and were left out. A step without tests counts as one.
count() {
    awk -v status="$2" '
        /^== left out: / { skipped++ }
        /^test result: / { passed += $4; failed += $6 }
        /^[0-9]+ cases passed, [0-9]+ failed$/ { passed += $1; failed += $4 }
        END {
            if (status != 0 && failed == 0) failed = 1
            if (passed + failed + skipped == 0) passed = 1
            print passed + 0, failed + 0, skipped + 0
        }' "$1"
}

# run_step NAME: runs a step, shows its headings, and its output if it fails; adds its row to the table.
run_step() {
    local start=$SECONDS log=$TMPDIR/log status passed failed skipped note
    echo "== $1"
    # A shell of its own, so that `set -e` ends the step alone. setup.sh may have installed another Rust before.
    (
        set -e
        . scripts/common.sh
        "step_$(echo "$1" | tr '.-' '__')"
    ) 2>&1 </dev/null | tee "$log" | grep --line-buffered '^== '
    status=${PIPESTATUS[0]}
    read -r passed failed skipped <<<"$(count "$log" "$status")"
    note=$(sed -n 's/^== left out: /left out: /p' "$log" | head -n 1)
    if [ "$status" != 0 ]; then
        echo "-- $1 failed with status $status; the last lines of its output:"
        tail -n 300 "$log"
        echo "--"
    fi
    rows+=$(printf "$columns   %s" "$1" "$((SECONDS - start)) s" "$passed" "$failed" "$skipped" "$note")$'\n'
    all_passed=$((all_passed + passed)) all_failed=$((all_failed + failed)) all_skipped=$((all_skipped + skipped))
}

all="setup fmt clippy unit suite gpu doc features packages wasm examples docs rapier-0.36"
if [ "${1:-}" = --no-setup ]; then
    all=${all#setup }
    shift
fi
[ $# -gt 0 ] || set -- $all
for name in "$@"; do
    case " $all " in *" $name "*) ;; *) echo "there is no step '$name'; the steps: $all" >&2 && exit 2 ;; esac
done
columns='%-12s %8s %8s %8s %8s'
rows='' all_passed=0 all_failed=0 all_skipped=0
for name in "$@"; do
    run_step "$name"
done
printf "\n$columns\n%s" step time passed failed skipped "$rows"
printf "$columns\n\n%s\n" all "$SECONDS s" "$all_passed" "$all_failed" "$all_skipped" \
    "$all_passed passed, $all_failed failed, $all_skipped skipped"
[ "$all_failed" = 0 ]
