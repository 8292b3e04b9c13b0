# Functions that the other scripts share; they source this file from the repository's root.
PATH=$PATH:/usr/sbin:/sbin
if [ -f "${HOME:-}/.cargo/env" ]; then . "$HOME/.cargo/env"; fi

# has COMMAND: the command is there.
has() {
    command -v "$1" >/dev/null 2>&1
}

# has_rust: a toolchain new enough for the workspace, with the two tools that come beside it.
has_rust() {
    local wanted found
    wanted=$(sed -n 's/^rust-version = "\(.*\)"/\1/p' Cargo.toml)
    found=$(rustc --version 2>/dev/null | cut -d' ' -f2) || return 1
    [ "$(printf '%s\n' "$wanted" "$found" | sort -t . -k1,1n -k2,2n | head -n 1)" = "$wanted" ] &&
        cargo fmt --version >/dev/null 2>&1 && cargo clippy --version >/dev/null 2>&1
}

# The toolchain that setup.sh installs, where the usual one is too old.
if has rustup && ! has_rust; then export RUSTUP_TOOLCHAIN=stable; fi

# has_target TARGET: the toolchain in use has the standard library for the target.
has_target() {
    [ -d "$(rustc --print target-libdir --target "$1" 2>/dev/null)" ]
}

# has_std_source: the system's own Rust has the source of its standard library.
has_std_source() {
    [ -x /usr/bin/cargo ] && [ -d "$(/usr/bin/rustc --print sysroot 2>/dev/null)/lib/rustlib/src/rust/library" ]
}

# choose_cargo TARGET: sets `cargo` to a command that can build for the target, and `builds_std` to whether it has to build
# the standard library, too: Debian's Rust does, where rustup has none for the target.
choose_cargo() {
    cargo=(cargo) builds_std=false
    ! has_target "$1" || return 0
    has_std_source || return 1
    # The nightly feature works in this release, which also is the only one whose source is here.
    cargo=(env -u RUSTUP_TOOLCHAIN PATH=/usr/bin:/bin RUSTC=/usr/bin/rustc RUSTC_BOOTSTRAP=1
        /usr/bin/cargo -Z build-std=std,panic_abort)
    builds_std=true
}

# wasm_linker: the linker that Debian's Rust needs for WebAssembly, of its own LLVM.
wasm_linker() {
    echo "/usr/bin/wasm-ld-$(/usr/bin/rustc -vV | sed -n 's/^LLVM version: \([0-9]*\).*/\1/p')"
}

# use_wasm_linker: names the linker to cargo, where it builds the standard library.
use_wasm_linker() {
    if $builds_std; then
        export CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_LINKER
        CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_LINKER=$(wasm_linker)
    fi
}

# target_folder: cargo's folder for what it builds, as an absolute path. Call it where cargo is called: a relative
# CARGO_TARGET_DIR starts there.
target_folder() {
    cargo metadata --no-deps --format-version 1 | sed 's/.*"target_directory":"\([^"]*\)".*/\1/'
}

# Where setup.sh installs a Node for the page's tests, if the system's is too old.
node_folder=out/node

# new_node: prints a Node of version 22.12 or newer, which the page's tests need.
new_node() {
    local node is_new='const [major, minor] = process.versions.node.split(".").map(Number)
        process.exit(major > 22 || (major === 22 && minor >= 12) ? 0 : 1)'
    for node in node "$PWD/$node_folder/node_modules/node/bin/node"; do
        if has "$node" && "$node" -e "$is_new"; then echo "$node" && return; fi
    done
    return 1
}

# has_libraries FILE...: the dynamic linker knows each library.
has_libraries() {
    local known file
    known=$(ldconfig -p 2>/dev/null)
    for file in "$@"; do
        case $known in *"$file "*) ;; *) return 1 ;; esac
    done
}

# left_out WHAT [REMEDY]: says that something cannot run here, and what to do. With CI=true it ends the script as a failure.
left_out() {
    echo "== left out: $1; ${2:-scripts/setup.sh installs what is missing}"
    [ "${CI:-}" != true ] || exit 1
}

# step COMMAND...: runs a command below a heading.
step() {
    echo "== $*"
    "$@"
}
