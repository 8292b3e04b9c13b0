#!/usr/bin/env bash
# Runs the corpus as an aarch64 program under qemu; installs what is missing as test.sh does:
#   scripts/aarch64.sh
# It takes about five minutes, most of them in the emulator.
set -euo pipefail
cd "$(dirname "$0")/.."
. scripts/cross.sh
target=aarch64-unknown-linux-gnu

has_emulator() {
    command -v aarch64-linux-gnu-gcc >/dev/null && command -v qemu-aarch64-static >/dev/null
}

if [ -f "${HOME:-}/.cargo/env" ]; then . "$HOME/.cargo/env"; fi
choose_cargo "$target" || left_out "$target"
has_emulator || require "a linker and an emulator for aarch64" gcc-aarch64-linux-gnu libc6-dev-arm64-cross qemu-user-static
has_emulator || left_out "$target"
export CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER=aarch64-linux-gnu-gcc
export CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_RUNNER="qemu-aarch64-static -L /usr/aarch64-linux-gnu"
step "${cargo[@]}" run --quiet --release --manifest-path wasm/Cargo.toml --target "$target" --target-dir target/aarch64
echo "== aarch64: all passed"
