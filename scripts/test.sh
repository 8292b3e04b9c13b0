#!/usr/bin/env bash
# The one test command: formatting, lints, all tests, docs. On a fresh Debian or Ubuntu machine it
# first installs what is missing, if it may (root, or sudo without a password), and says what;
# otherwise it prints the command to run. Without a GPU adapter (a software one will do) it leaves out
# what needs one, and says so. With CI=true a missing part is a failure.
set -euo pipefail
cd "$(dirname "$0")/.."
. scripts/packages.sh

# On Linux the adapters are Vulkan's; other systems bring theirs.
has_vulkan() {
    [ "$(uname)" = Linux ] || return 0
    case $(ldconfig -p 2>/dev/null) in *libvulkan.so.1*) ;; *) return 1 ;; esac
    compgen -G '/usr/share/vulkan/icd.d/*.json' >/dev/null || compgen -G '/etc/vulkan/icd.d/*.json' >/dev/null
}

# has_rust: a toolchain new enough for the workspace, with the two tools that come beside it.
has_rust() {
    local wanted found
    wanted=$(sed -n 's/^rust-version = "\(.*\)"/\1/p' Cargo.toml)
    found=$(rustc --version 2>/dev/null | cut -d' ' -f2) || return 1
    [ "$(printf '%s\n' "$wanted" "$found" | sort -V | head -n 1)" = "$wanted" ] &&
        cargo fmt --version >/dev/null 2>&1 && cargo clippy --version >/dev/null 2>&1
}

# Rust comes through rustup: distributions' own compilers are often too old.
require_rust() {
    if ! command -v rustup >/dev/null && may_install && [ -n "$(apt-cache policy rustup 2>/dev/null)" ]; then
        require "rustup" rustup
    fi
    if command -v rustup >/dev/null; then
        step rustup toolchain install stable --profile minimal --component rustfmt,clippy
        export RUSTUP_TOOLCHAIN=stable
    fi
    has_rust || give_up "Rust with rustfmt and clippy" "curl -sSf https://sh.rustup.rs | sh"
}

# look_for_adapter: sets `has_gpu`, by the program once it is built.
look_for_adapter() {
    case $(target/release/pbig doctor) in
    *"adapters: none"*) has_gpu=false ;;
    *) has_gpu=true ;;
    esac
    if ! $has_gpu && [ "${CI:-}" = true ]; then
        echo "== there is no GPU adapter"
        exit 1
    fi
}

# gpu_step COMMAND...: a step that fails without an adapter.
gpu_step() {
    if $has_gpu; then step "$@"; else echo "== left out, there is no GPU adapter: $*"; fi
}

# lacks PACKAGE CRATE [OPTION...]: fails if the package depends on the crate.
lacks() {
    local package=$1 crate=$2 tree
    shift 2
    tree=$(cargo tree --package "$package" --edges normal --prefix none "$@")
    case $'\n'$tree in *$'\n'"$crate v"*) echo "== $package pulls in $crate" && exit 1 ;; esac
}

if [ -f "${HOME:-}/.cargo/env" ]; then . "$HOME/.cargo/env"; fi
command -v cc >/dev/null || require "a C compiler, for linking," build-essential
has_rust || require_rust
command -v patch >/dev/null || require "the program patch" patch
has_vulkan || require "a Vulkan driver (this software one will do)" mesa-vulkan-drivers libvulkan1

# Planted faults leave files for `pbig replay` in the folder for temporary files.
TMPDIR=$(mktemp -d)
export TMPDIR
trap 'rm -rf "$TMPDIR"' EXIT

# One profile and one set of features: everything is built once, pbig-core alone a second time.
step cargo fmt --all --check
# Workspaces of their own.
for other in fuzz wasm; do
    step cargo fmt --manifest-path "$other/Cargo.toml" --check
done
step cargo clippy --release --workspace --all-targets -- -D warnings
# As apps build them: without the GPU backend, with one feature or with none.
for feature in '' serde debug-render shadow; do
    step cargo clippy --release -p rapier-pbig --features "$feature" -- -D warnings
done
for package in pbig-core rapier-pbig; do
    step cargo clippy --release -p "$package" --no-default-features -- -D warnings
    lacks "$package" rayon --no-default-features
    lacks "$package" wgpu
done
lacks pbig-wasm rayon --manifest-path wasm/Cargo.toml
step cargo build --release --workspace --examples --bins
look_for_adapter
# The suite and the program are tested on every backend, and fail where the CPU does a GPU's work.
gpu_step cargo test --release --workspace
$has_gpu || step cargo test --release --workspace --exclude pbig-tests --exclude pbig-cli --exclude pbig-studies
# Rapier's own features beside these are in scripts/features.sh; one of the other kind for all.
gpu_step scripts/features.sh deterministic
# Once more with overflow checks and debug assertions, where there is unsafe code and index arithmetic.
step cargo test -p pbig-core --features serde,unstable-study
# The adapter for rapier 0.36, in a workspace of its own: cargo replaces rapier there by a patched copy.
step scripts/patch-rapier.sh rapier-0.36
step scripts/patch-rapier-test.sh
in_036="--manifest-path rapier-0.36/Cargo.toml"
step cargo fmt $in_036 -p rapier-pbig -p pbig-harness-036 --check
step cargo clippy --release $in_036 -p rapier-pbig -p pbig-harness-036 --all-targets -- -D warnings
for options in '--no-default-features' '--features gpu,shadow'; do
    step cargo clippy --release $in_036 -p rapier-pbig $options -- -D warnings
done
step cargo test --release $in_036 -p rapier-pbig -p pbig-harness-036
step cargo test --release $in_036 -p pbig-harness-036 --no-default-features --features enhanced-determinism
step cargo run --release $in_036 --example falling_objects -- --bodies 500 --steps 60
RUSTDOCFLAGS="-D warnings" step cargo doc --release $in_036 -p rapier-pbig --features shadow --no-deps --quiet
# The commands that the README shows, at a size that takes seconds.
step target/release/examples/falling_objects --bodies 500 --steps 60
step target/release/examples/drop_in
step target/release/examples/headless_test
step target/release/examples/debug_render
step target/release/examples/boxes_to_pairs
gpu_step target/release/examples/own_device
step target/release/pbig pairs examples/boxes.csv
step target/release/pbig replay examples/frames.npy
step target/release/pbig simulate --scene pile --check --backend gpu --bodies 1500 --steps 20
gpu_step target/release/pbig bench gpu --quick
# The corpus as a WebAssembly module.
step scripts/wasm.sh
RUSTDOCFLAGS="-D warnings" step cargo doc --release --workspace --no-deps --quiet
if $has_gpu; then echo "== all passed"; else echo "== all passed, but for what was left out"; fi
