#!/usr/bin/env bash
# Mutation testing: what pbig-core's unit tests do not notice.
#   scripts/mutants.sh [K/N]     of every N-th mutant, beginning with the K-th (0/1, all, takes a day on two cores)
# Needs cargo-mutants (cargo install cargo-mutants).
# The results are in mutants.out: caught.txt, missed.txt, timeout.txt and unviable.txt.
set -euo pipefail
cd "$(dirname "$0")/.."
export CARGO_PROFILE_DEV_OPT_LEVEL=2 CARGO_PROFILE_DEV_DEBUG=0
cargo mutants -p pbig-core --features serde --shard "${1:-0/1}" \
    --sharding round-robin --no-shuffle --timeout 300 -- --lib --tests
