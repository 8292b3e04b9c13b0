#!/usr/bin/env bash
# Fuzzes, one target after the other, each for so many seconds (600 without a number):
#   scripts/fuzz.sh [SECONDS] [TARGET...]
# Needs nightly Rust and cargo-fuzz (cargo install cargo-fuzz). Seeds are made from the box sets and scenes; the corpus
# stays in fuzz/corpus and grows from run to run. What fails lies in fuzz/artifacts: move it to fuzz/failed/TARGET,
# where the test suite runs it from then on, and mend the cause.
set -euo pipefail
cd "$(dirname "$0")/.."
seconds=${1:-600}
shift || true
[ $# -gt 0 ] || set -- finder_against_oracle updates_against_scratch work_is_bounded decode csv_reader npy_reader

# length TARGET: the length in bytes at which an input takes milliseconds, and no allocation that the input does not account for.
length() {
    case $1 in
    finder_against_oracle) echo 1600 ;;
    updates_against_scratch) echo 800 ;;
    work_is_bounded) echo 100 ;;
    *) echo 4096 ;;
    esac
}

cargo run --release -p pbig-tests --example fuzz_seeds
for target in "$@"; do
    echo "== $target"
    words=''
    [ ! -f "fuzz/$target.dict" ] || words="-dict=fuzz/$target.dict"
    # Inputs of every length from the beginning: by itself libFuzzer stays below 30 bytes for minutes.
    cargo +nightly fuzz run "$target" -- -len_control=0 -max_total_time="$seconds" -max_len="$(length "$target")" \
        -malloc_limit_mb=64 -timeout=60 -print_final_stats=1 $words
done
