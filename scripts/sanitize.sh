#!/usr/bin/env bash
# Undefined behaviour: pbig-core's unit tests, which reach all of its unsafe code, with sanitizers:
#   scripts/sanitize.sh [address] [thread]     without an argument: both
# Needs nightly Rust, and the thread sanitizer its component rust-src: where the standard library is not instrumented
# its locks are not seen, and every exchange between rayon's threads is reported as a race.
set -euo pipefail
cd "$(dirname "$0")/.."
[ $# -gt 0 ] || set -- address thread
host=$(rustc +nightly -vV | sed -n 's/^host: //p')
std=()
if [ -f "$(rustc +nightly --print sysroot)/lib/rustlib/src/rust/library/Cargo.lock" ]; then std=(-Zbuild-std); fi
# Optimized a little, with overflow checks and debug assertions; a folder for each sanitizer.
export CARGO_PROFILE_DEV_OPT_LEVEL=1 CARGO_PROFILE_DEV_DEBUG=line-tables-only
for sanitizer in "$@"; do
    if [ "$sanitizer" = thread ] && [ ${#std[@]} = 0 ]; then
        echo "the thread sanitizer needs: rustup component add rust-src --toolchain nightly"
        exit 1
    fi
    echo "== $sanitizer sanitizer${std:+, standard library included}"
    RUSTFLAGS="-Zsanitizer=$sanitizer" cargo +nightly test "${std[@]}" --target "$host" \
        --target-dir "target/sanitize-$sanitizer" -p pbig-core --features serde --lib
done
