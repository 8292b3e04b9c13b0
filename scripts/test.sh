#!/usr/bin/env bash
# The one test command: formatting, lints, all tests, docs. On a fresh Debian or Ubuntu machine it
# first installs what is missing, if it may (root, or sudo without a password), and says what;
# otherwise it prints the command to run. With CI=true a missing part is a failure.
set -euo pipefail
cd "$(dirname "$0")/.."

may_install() {
    command -v apt-get >/dev/null && { [ "$(id -u)" = 0 ] || sudo -n true 2>/dev/null; }
}

as_root() {
    if [ "$(id -u)" = 0 ]; then "$@"; else sudo -n "$@"; fi
}

# require WHAT PACKAGE...: installs the packages that bring WHAT, or says how.
require() {
    local what=$1
    shift
    if may_install; then
        echo "== $what is missing: installing $*"
        as_root apt-get update -qq
        DEBIAN_FRONTEND=noninteractive as_root apt-get install -y -qq --no-install-recommends "$@" >/dev/null
    else
        echo "== $what is missing; install it with: sudo apt-get install $*"
        [ "${CI:-}" != true ] || exit 1
    fi
}

has_vulkan() {
    ldconfig -p 2>/dev/null | grep -q libvulkan.so.1 &&
        ls /usr/share/vulkan/icd.d/*.json /etc/vulkan/icd.d/*.json >/dev/null 2>&1
}

step() {
    echo "== $*"
    "$@"
}

[ -f "$HOME/.cargo/env" ] && . "$HOME/.cargo/env"
command -v cc >/dev/null || require "a C compiler, for linking," build-essential
if ! command -v cargo >/dev/null; then
    require "the Rust toolchain" rustup
    command -v rustup >/dev/null && step rustup default stable
fi
cargo fmt --version >/dev/null 2>&1 && cargo clippy --version >/dev/null 2>&1 ||
    step rustup component add rustfmt clippy
has_vulkan || require "a Vulkan driver (this software one will do)" mesa-vulkan-drivers libvulkan1

# One profile and one set of features: everything is built once, pbig-core alone a second time.
step cargo fmt --all --check
step cargo clippy --release --workspace --all-targets -- -D warnings
step cargo build --release --workspace --examples --bins
step cargo test --release --workspace
# Once more with overflow checks and debug assertions, where there is unsafe code and index arithmetic.
step cargo test -p pbig-core
# The commands that the README shows, at a size that takes seconds.
step target/release/examples/falling_objects --bodies 500 --steps 60
step target/release/examples/drop_in
step target/release/examples/headless_test
step target/release/examples/boxes_to_pairs
RUSTDOCFLAGS="-D warnings" step cargo doc --release --workspace --no-deps --quiet
cargo tree -p pbig-core --edges normal | grep -q wgpu && { echo "pbig-core pulls in wgpu"; exit 1; }
echo "== all passed"
