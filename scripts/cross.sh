# Finds a cargo that builds for another target; other scripts source this file.
. scripts/packages.sh

# has_target TARGET: the toolchain in use has the standard library for the target.
has_target() {
    [ -d "$(rustc --print target-libdir --target "$1" 2>/dev/null)" ]
}

# has_std_source: the system's own Rust has the source of its standard library.
has_std_source() {
    [ -x /usr/bin/cargo ] && [ -d "$(/usr/bin/rustc --print sysroot 2>/dev/null)/lib/rustlib/src/rust/library" ]
}

# choose_cargo TARGET: sets `cargo` to a command that can build for the target, and `builds_std` to whether it
# has to build the standard library, too. Where rustup cannot bring it for the target, Debian's Rust does that.
choose_cargo() {
    cargo=(cargo) builds_std=false
    ! has_target "$1" || return 0
    ! command -v rustup >/dev/null || step rustup target add "$1" || true
    ! has_target "$1" || return 0
    has_std_source || ! may_install || require "Rust for $1" rustc-web cargo-web rust-web-src
    has_std_source || { give_up "the standard library for $1" "rustup target add $1" && return 1; }
    # The nightly feature works in this release, which also is the only one whose source is here.
    cargo=(env -u RUSTUP_TOOLCHAIN PATH=/usr/bin:/bin RUSTC=/usr/bin/rustc RUSTC_BOOTSTRAP=1
        /usr/bin/cargo -Z build-std=std,panic_abort)
    builds_std=true
}

# left_out WHAT: ends a script that could not run. With CI=true `give_up` has ended it as a failure before.
left_out() {
    echo "== left out: $1"
    exit 0
}
