#!/usr/bin/env bash
# Undefined behaviour: pbig-core's unit tests, which reach all of its unsafe code, with sanitizers:
#   scripts/sanitize.sh [address] [thread]     without an argument: both
# Needs nightly Rust, and the thread sanitizer its component rust-src: where the standard library is not instrumented
# its locks are not seen, and every exchange between rayon's threads is reported as a race.
# PBIG_SUITE=1: the whole test suite instead. With the address sanitizer on the GPU at hand, whose driver is not instrumented:
# what it does itself is not looked at. Leaks are not looked for, as drivers keep what they have. With the thread sanitizer
# without a GPU, as that one has to know a driver's threads, too: PBIG_GPU=none leaves the strategies on one out of the suite,
# and ends tests of nothing else early. (The suite fails if it is set with CI=true, or to anything else.)
# PBIG_RUST: the folder of another rustc and cargo, which may be stable. Debian's rustc-web, cargo-web, libstd-rust-web-dev
# and rust-web-src will do (PBIG_RUST=/usr/bin), with the file librustc-stable_rt.tsan.a of a rustup toolchain of the same
# LLVM beside their standard library.
set -euo pipefail
cd "$(dirname "$0")/.."
. scripts/common.sh
folder=$(target_folder)
[ $# -gt 0 ] || set -- address thread
if [ -n "${PBIG_RUST:-}" ]; then
    export RUSTC="$PBIG_RUST/rustc" RUSTC_BOOTSTRAP=1
    rustc=("$RUSTC") cargo=("$PBIG_RUST/cargo")
else
    rustc=(rustc +nightly) cargo=(cargo +nightly)
fi
host=$("${rustc[@]}" -vV | sed -n 's/^host: //p')
std=()
if [ -f "$("${rustc[@]}" --print sysroot)/lib/rustlib/src/rust/library/Cargo.lock" ]; then std=(-Zbuild-std); fi
what=(-p pbig-core --features serde --lib)
# Optimized a little, with overflow checks and debug assertions; a folder for each sanitizer.
export CARGO_PROFILE_DEV_OPT_LEVEL=1 CARGO_PROFILE_DEV_DEBUG=line-tables-only
if [ -n "${PBIG_SUITE:-}" ]; then
    what=(--workspace --test suite)
    export CARGO_PROFILE_DEV_OPT_LEVEL=2
    export ASAN_OPTIONS=${ASAN_OPTIONS:+$ASAN_OPTIONS:}detect_leaks=0
    export TSAN_OPTIONS=${TSAN_OPTIONS:+$TSAN_OPTIONS:}ignore_noninstrumented_modules=1
fi
for sanitizer in "$@"; do
    if [ "$sanitizer" = thread ] && [ ${#std[@]} = 0 ]; then
        echo "the thread sanitizer needs: rustup component add rust-src --toolchain nightly"
        exit 1
    fi
    gpu=()
    if [ "$sanitizer" = thread ] && [ -n "${PBIG_SUITE:-}" ]; then gpu=(PBIG_GPU=none); fi
    echo "== $sanitizer sanitizer${std[0]+, standard library included}${gpu[0]+, ${gpu[*]}}"
    env ${gpu[@]+"${gpu[@]}"} RUSTFLAGS="-Zsanitizer=$sanitizer" "${cargo[@]}" test ${std[@]+"${std[@]}"} --target "$host" \
        --target-dir "$folder/sanitize-$sanitizer" "${what[@]}"
done
