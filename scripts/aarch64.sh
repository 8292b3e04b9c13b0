#!/usr/bin/env bash
# Runs pbig-core's unit tests, the corpus and a rapier world as aarch64 programs under qemu:
#   scripts/aarch64.sh [--no-setup]     it calls setup.sh first, unless told not to
# It takes about ten minutes, most of them in the emulator.
set -euo pipefail
cd "$(dirname "$0")/.."
[ "${1:-}" = --no-setup ] || scripts/setup.sh rust aarch64 || true
. scripts/common.sh
target=aarch64-unknown-linux-gnu

choose_cargo "$target" && has aarch64-linux-gnu-gcc && has qemu-aarch64-static || { left_out "$target" && exit 0; }
export CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_LINKER=aarch64-linux-gnu-gcc
export CARGO_TARGET_AARCH64_UNKNOWN_LINUX_GNU_RUNNER="qemu-aarch64-static -L /usr/aarch64-linux-gnu"
folder="$(target_folder)/aarch64"
step "${cargo[@]}" test --locked --release -p pbig-core --features serde --lib --target "$target" \
    --target-dir "$folder"
step "${cargo[@]}" run --locked --release --manifest-path wasm/Cargo.toml --target "$target" --target-dir "$folder"
echo "== aarch64: all passed"
