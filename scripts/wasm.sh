#!/usr/bin/env bash
# Runs the corpus and a rapier world as a WebAssembly module under node, without and with SIMD, and checks that the scenes compile:
#   scripts/wasm.sh [--no-setup]     it calls setup.sh first, unless told not to
# From clean it takes two minutes; more where Debian's Rust has to build the standard library for the target, twice.
set -euo pipefail
cd "$(dirname "$0")/.."
[ "${1:-}" = --no-setup ] || scripts/setup.sh rust wasm || true
. scripts/common.sh
target=wasm32-unknown-unknown

# run NAME FLAGS: builds the module with these flags of rustc, and runs it.
run() {
    echo "== WebAssembly $1"
    RUSTFLAGS=$2 step "${cargo[@]}" build --locked --quiet --release --lib --manifest-path wasm/Cargo.toml \
        --target "$target" --target-dir "$folder"
    step node wasm/run.mjs "$folder/$target/release/pbig_wasm.wasm"
}

choose_cargo "$target" && has node || { left_out "$target" && exit 0; }
if $builds_std; then
    export CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_LINKER
    CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_LINKER=$(wasm_linker)
fi
folder="$(target_folder)/wasm"
run "without SIMD" ""
run "with SIMD" "-C target-feature=+simd128"
step "${cargo[@]}" check --locked --quiet --release --package pbig-scenes --target "$target" --target-dir "$folder"
echo "== WebAssembly: all passed"
