#!/usr/bin/env bash
# Undefined behaviour: pbig-core's unit tests, in which all of its unsafe code is reached, with sanitizers:
#   scripts/sanitize.sh [address] [thread]     without an argument: both
# Needs nightly Rust. With its component rust-src the standard library is instrumented, too; without it the thread
# sanitizer cannot see how it synchronizes, so that rayon's own synchronization may be reported.
set -euo pipefail
cd "$(dirname "$0")/.."
[ $# -gt 0 ] || set -- address thread
host=$(rustc +nightly -vV | sed -n 's/^host: //p')
std=()
if [ -f "$(rustc +nightly --print sysroot)/lib/rustlib/src/rust/library/Cargo.lock" ]; then std=(-Zbuild-std); fi
# Optimized a little, with overflow checks and debug assertions; a folder for each sanitizer.
export CARGO_PROFILE_DEV_OPT_LEVEL=1 CARGO_PROFILE_DEV_DEBUG=line-tables-only
for sanitizer in "$@"; do
    echo "== $sanitizer sanitizer${std:+, standard library included}"
    flags="-Zsanitizer=$sanitizer"
    # Flags differ from those of the standard library that is not built anew.
    if [ ${#std[@]} = 0 ] && [ "$sanitizer" = thread ]; then flags+=" -Cunsafe-allow-abi-mismatch=sanitizer"; fi
    RUSTFLAGS=$flags TSAN_OPTIONS="suppressions=$PWD/scripts/thread-sanitizer.txt" \
        cargo +nightly test "${std[@]}" --target "$host" --target-dir "target/sanitize-$sanitizer" \
        -p pbig-core --features serde --lib -- --test-threads=1
done
