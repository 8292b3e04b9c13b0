#!/usr/bin/env bash
# Runs the corpus as a WebAssembly module under node, without and with SIMD; installs what is missing as test.sh does:
#   scripts/wasm.sh
# From clean it takes a minute or two; four where Debian's Rust has to build the standard library for the target, twice.
set -euo pipefail
cd "$(dirname "$0")/.."
. scripts/cross.sh
target=wasm32-unknown-unknown

# require_linker: rustup brings a linker for the target; Debian's Rust needs the one of its own LLVM.
require_linker() {
    local llvm linker
    llvm=$(/usr/bin/rustc -vV | sed -n 's/^LLVM version: \([0-9]*\).*/\1/p')
    linker=/usr/bin/wasm-ld-$llvm
    [ -x "$linker" ] || require "a linker for WebAssembly" "lld-$llvm"
    export CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_LINKER=$linker
    [ -x "$linker" ]
}

# run NAME FLAGS: builds the module with these flags of rustc, and runs it.
run() {
    echo "== WebAssembly $1"
    RUSTFLAGS=$2 step "${cargo[@]}" build --quiet --release --lib --manifest-path wasm/Cargo.toml \
        --target "$target" --target-dir target/wasm
    step node wasm/run.mjs "target/wasm/$target/release/pbig_wasm.wasm"
}

if [ -f "${HOME:-}/.cargo/env" ]; then . "$HOME/.cargo/env"; fi
choose_cargo "$target" || left_out "$target"
! $builds_std || require_linker || left_out "$target"
command -v node >/dev/null || require node nodejs
command -v node >/dev/null || left_out "$target"
run "without SIMD" ""
run "with SIMD" "-C target-feature=+simd128"
echo "== WebAssembly: all passed"
