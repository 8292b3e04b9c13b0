#!/usr/bin/env bash
# Checks beside scripts/test.sh, each with a name:
#   scripts/extra.sh [--no-setup] NAME [ARGUMENT...]     it calls setup.sh first, unless told not to
#   features [KIND...]     rapier's own features, and sets of pbig's: see `test_features`
#   publish                what would be published; publishes nothing
#   wasm                   the corpus and a rapier world under node, pbig without and with SIMD; from clean two minutes
#   aarch64, windows       pbig-core's unit tests, the corpus and a rapier world under qemu, under wine; ten minutes, five
#   targets                checks that core, GPU and rapier 0.27 compile for Windows, macOS, iOS and Android; five minutes
#   viewer                 builds, lints and tests the viewer
#   pictures               makes docs/images again from a fixed seed, with the times of this machine
#   avian                  lints and tests the plug-ins for avian; builds bevy, from clean ten minutes
#   python                 installs the package for Python in a new environment, and tests it; from clean three minutes
#   sanitize KIND          pbig-core's unit tests with a sanitizer, `address` or `thread`
#   fuzz [SECONDS] [TARGET...]     each target for 600 seconds; needs nightly Rust and cargo-fuzz
set -euo pipefail
cd "$(dirname "$0")/.."
. scripts/common.sh

# sets FEATURE...: prints sets of features, one a line, separated by commas: none, then all without each. With three features or more, any
# two of them meet on and off in every way. A FEATURE may be NAME=ENGINE_FEATURE. Then the set without NAME has ENGINE_FEATURE: the engine
# has the same features in all sets but the first, so it is checked once, and NAME has to ask for its ENGINE_FEATURE in the other sets.
sets() {
    local feature other line
    echo
    for feature in "$@"; do
        line=
        for other in "$@"; do
            if [ "$other" != "$feature" ]; then
                line+=,${other%%=*}
            elif [ "$other" != "${other#*=}" ]; then
                line+=,${other#*=}
            fi
        done
        echo "${line#,}"
    done
}

# lint PACKAGE OPTIONS FEATURE...: lints a package, and its dependencies of the workspace, with sets of the features. test.sh lints it
# with all of them.
lint() {
    local package=$1 options=$2 set
    shift 2
    sets "$@" | while read -r set; do
        echo "== $package with '$set'"
        # Not quoted: several words, or none.
        cargo clippy --quiet --locked --release $options -p "$package" --no-default-features --features "$set" -- -D warnings \
            </dev/null
    done
}

# test_features KIND: none, parallel, simd and deterministic test all that depends on rapier, with this feature of rapier alone
# (`parallel`, `simd-stable`, `enhanced-determinism`). sets and sets-0.36 lint pbig with sets of its features.
test_features() {
    local kind=$1
    case $kind in
    sets)
        lint rapier-pbig "" shadow parallel gpu serde=rapier3d/serde-serialize debug-render=rapier3d/debug-render
        lint pbig-gpu ""
        ;;
    sets-0.36)
        lint rapier3d-pbig "--manifest-path rapier-0.36/Cargo.toml" shadow parallel gpu debug-render=rapier/debug-render
        ;;
    *)
        step cargo test --locked --release -p pbig-tests --no-default-features --features "${kind#none}" --test suite -- \
            calls drop_in upstream restore queries explain random_worlds worlds::a_scene_gives
        ;;
    esac
}

run_features() {
    [ $# -gt 0 ] || set -- none parallel simd deterministic
    for kind in "$@"; do test_features "$kind"; done
}

# check_contents FOLDER: the package has a README and the licences. These are copies, because links break on Windows.
check_contents() {
    local files file
    files=$(cargo package --locked --list --allow-dirty --manifest-path "$1/Cargo.toml")
    for file in README.md LICENSE-MIT LICENSE-APACHE; do
        case $'\n'$files$'\n' in *$'\n'"$file"$'\n'*) ;; *) echo "$1 has no $file" && exit 1 ;; esac
    done
    cmp LICENSE-MIT "$1/LICENSE-MIT"
    cmp LICENSE-APACHE "$1/LICENSE-APACHE"
}

# check_dependencies: licences, sources and known vulnerabilities; the list of these comes from outside.
check_dependencies() {
    has cargo-deny || { left_out "cargo-deny" && return; }
    step cargo deny --locked check licenses bans sources
    if cargo deny --locked fetch db 2>/dev/null; then
        step cargo deny --locked check advisories
    else
        echo "== left out: advisories; their list cannot be fetched"
    fi
}

# check_interface OPTION...: compares the interface with the last release's, once there is one.
check_interface() {
    local tag
    tag=$(git describe --tags --abbrev=0 --match 'v*' 2>/dev/null) || return 0
    has cargo-semver-checks || { left_out "a comparison with $tag, which needs cargo-semver-checks" && return; }
    step cargo semver-checks --baseline-rev "$tag" "$@"
}

# oldest: prints a setting that chooses the oldest Rust that is supported.
oldest() {
    local version
    version=$(sed -n 's/^rust-version = "\(.*\)"/\1/p' Cargo.toml)
    if has rustup && rustup run "$version" rustc --version >/dev/null 2>&1; then
        echo "RUSTUP_TOOLCHAIN=$version"
    else
        left_out "a build with Rust $version" >&2
    fi
}

run_publish() {
    local options="-p pbig-shaders -p pbig-core -p pbig-gpu -p pbig-adapter -p rapier-pbig" folder toolchain
    for folder in shaders crates/pbig-core crates/pbig-gpu crates/pbig-adapter crates/rapier-pbig avian/avian2d-pbig avian/avian3d-pbig; do
        check_contents "$folder"
    done
    check_dependencies
    check_interface $options
    # Each is built from its package, against the others' packages; by the oldest Rust, if it is there.
    # Cargo keeps what it has unpacked in an earlier dry run from the same folder, and would build against that.
    rm -rf "${CARGO_HOME:-$HOME/.cargo}"/registry/{src,cache}/-*/{pbig,rapier-pbig}-* "$(target_folder)/publish/package" 2>/dev/null || true
    toolchain=$(oldest)
    step env $toolchain CARGO_PROFILE_DEV_DEBUG=false cargo publish --dry-run --locked --allow-dirty $options \
        --target-dir "$(target_folder)/publish"
}

# wasm_module NAME [VARIABLE]: builds the module in this environment, and runs it.
wasm_module() {
    echo "== WebAssembly $1"
    # Slower code of rapier has the same results, and compiles sooner.
    step env RUSTFLAGS= ${2:+"$2"} "${cargo[@]}" build --locked --quiet --profile wasm --lib --package pbig-wasm \
        --config profile.wasm.package.rapier3d.opt-level=1 --config profile.wasm.package.parry3d.opt-level=1 \
        --target "$target" --target-dir "$folder"
    step node wasm/run.mjs "$folder/$target/wasm/pbig_wasm.wasm"
}

# With SIMD only pbig's own crates are built again: cargo's wrapper of rustc is for these.
run_wasm() {
    local target=wasm32-unknown-unknown folder
    choose_cargo "$target" && has node || { left_out "$target" && return; }
    use_wasm_linker
    folder="$(target_folder)/wasm"
    mkdir -p "$folder"
    printf '#!/bin/sh\nexec "$@" -C target-feature=+simd128\n' >"$folder/rustc-simd"
    chmod +x "$folder/rustc-simd"
    wasm_module "without SIMD"
    wasm_module "with SIMD" RUSTC_WORKSPACE_WRAPPER="$folder/rustc-simd"
}

# elsewhere TARGET LINKER RUNNER...: tests for another system, whose programs RUNNER runs.
elsewhere() {
    local target=$1 linker=$2 folder name
    shift 2
    choose_cargo "$target" && has "$linker" && has "$1" || { left_out "$target" && return; }
    name=$(tr 'a-z-' 'A-Z_' <<<"$target")
    export "CARGO_TARGET_${name}_LINKER=$linker" "CARGO_TARGET_${name}_RUNNER=$*"
    folder="$(target_folder)/$target"
    # Debian's Rust has no clippy for this.
    ! has_target "$target" ||
        step cargo clippy --locked --release -p pbig-core --target "$target" --target-dir "$folder" -- -D warnings
    step "${cargo[@]}" test --locked --release -p pbig-core --features serde --lib --target "$target" \
        --target-dir "$folder"
    step "${cargo[@]}" run --locked --release --package pbig-wasm --target "$target" --target-dir "$folder"
}

run_aarch64() {
    elsewhere aarch64-unknown-linux-gnu aarch64-linux-gnu-gcc qemu-aarch64-static -L /usr/aarch64-linux-gnu
}

# Wine 8 lacks the function of Windows that gives Rust its random numbers.
run_windows() {
    local linker=x86_64-w64-mingw32-gcc
    { has wine && has "$linker"; } || { left_out "Windows" && return; }
    export WINEPREFIX=$PWD/out/wine WINEDEBUG=-all
    mkdir -p out
    wineboot --init
    "$linker" -shared -o "$WINEPREFIX/drive_c/windows/system32/bcryptprimitives.dll" -x c - -ladvapi32 <<'C'
unsigned char SystemFunction036(void *buffer, unsigned long bytes);
__declspec(dllexport) int ProcessPrng(void *buffer, unsigned long long bytes) { return SystemFunction036(buffer, bytes); }
C
    elsewhere x86_64-pc-windows-gnu "$linker" wine
}

run_targets() {
    local target
    for target in x86_64-pc-windows-msvc aarch64-apple-darwin aarch64-apple-ios aarch64-linux-android; do
        has_target "$target" || { left_out "$target" "rustup target add $target installs what it needs" && continue; }
        step cargo check --locked --release -p pbig-core -p pbig-gpu -p rapier-pbig --target "$target" --target-dir "$(target_folder)/targets"
    done
}

# The tests open a window under Xvfb, press each key, and leave screenshots in viewer/out. A software adapter will do.
run_viewer() {
    { has Xvfb && has xdotool && has_libraries libvulkan.so.1; } || { left_out "the viewer" && return; }
    step cargo build --locked --release --package pbig-viewer
    step cargo test --locked --release --package pbig-viewer -- --include-ignored
    step cargo clippy --locked --release --package pbig-viewer --all-targets -- -D warnings
}

# Bevy asks for a newer compiler than pbig: its own check of versions is left out.
run_avian() {
    local avian="--manifest-path avian/Cargo.toml --ignore-rust-version"
    step cargo fmt --manifest-path avian/Cargo.toml --all --check
    step cargo test --locked --release $avian
    step cargo clippy --locked --release $avian --all-targets -- -D warnings
}

# The candidates of a mesh are compared with those of ipctk, if it can be installed, and of the program `pbig`, if it has been built.
run_python() {
    local work python
    work=$(mktemp -d)
    trap "rm -rf '$work'" EXIT
    python3 -m venv "$work/venv" || { left_out "the package for Python" "it needs python3 with venv" && return; }
    export CARGO_TARGET_DIR PBIG_PROGRAM PYO3_PYTHON=$work/venv/bin/python
    CARGO_TARGET_DIR=$(target_folder)
    PBIG_PROGRAM=$CARGO_TARGET_DIR/release/pbig
    [ -x "$PBIG_PROGRAM" ] || unset PBIG_PROGRAM
    python=$PYO3_PYTHON
    step cargo fmt --manifest-path python/Cargo.toml --check
    step cargo clippy --locked --release --manifest-path python/Cargo.toml -- -D warnings
    step "$python" -m pip install --quiet ./python mypy pytest
    step "$python" -m pip install --quiet --only-binary :all: ipctk || echo "== left out: ipctk, which has no wheel for this Python"
    step "$python" -m mypy --strict python/package
    step "$python" -m pytest -q -r s -p no:cacheprovider python/tests
}

# pack PICTURE FROM: writes a PNG file of 256 colours, and fails if it is large.
pack() {
    pngquant --force --speed 1 --output "$1" 256 "$2"
    at_most 400000 "$1"
}

# at_most BYTES FILE: fails if the file is larger.
at_most() {
    local bytes
    bytes=$(wc -c <"$2")
    echo "$2: $bytes bytes of at most $1"
    [ "$bytes" -le "$1" ]
}

run_pictures() {
    { has img2webp && has pngquant; } || { left_out "the pictures" && return; }
    local images=docs/images work viewer
    work=$(mktemp -d)
    trap "rm -rf '$work'" EXIT
    step cargo build --locked --release --package pbig-viewer
    viewer=$(target_folder)/release/viewer
    # One run makes both: pictures of every 8th step, of which one is the README's.
    step "$viewer" --scene column --bodies 10000 --seed 1 --compare --size 1440x720 --steps 240 --every 8 --frames "$work/falling"
    pack "$images/falling.png" "$work/falling/00168.png"
    # Before the first step there is no time to show.
    rm "$work/falling/00000.png"
    # Each for the time of its 8 steps, in ms.
    img2webp -loop 0 -lossy -q 45 -m 4 -d 133 "$work"/falling/*.png -o "$images/falling.webp"
    at_most 3000000 "$images/falling.webp"
}

# Optimized a little, with overflow checks and debug assertions. The thread sanitizer has to instrument the standard library:
# otherwise it does not see locks, and reports each exchange between rayon's threads as a race.
run_sanitize() {
    local sanitizer=${1:-address} host std=''
    host=$(rustc -vV | sed -n 's/^host: //p')
    if [ "$sanitizer" = thread ]; then
        [ -d "$(rustc --print sysroot)/lib/rustlib/src" ] ||
            { left_out "the thread sanitizer" "rustup component add rust-src installs what it needs" && return; }
        std=-Zbuild-std
    fi
    export CARGO_PROFILE_DEV_DEBUG=line-tables-only
    step env RUSTC_BOOTSTRAP=1 RUSTFLAGS="-Zsanitizer=$sanitizer" cargo test $std --target "$host" \
        --target-dir "$(target_folder)/sanitize-$sanitizer" -p pbig-core --features serde --lib
}

# longest TARGET: the length in bytes at which an input takes milliseconds, and no allocation that the input does not account for.
longest() {
    case $1 in
    finder_against_oracle | between_against_oracle) echo 1600 ;;
    updates_against_scratch) echo 800 ;;
    work_is_bounded) echo 100 ;;
    *) echo 4096 ;;
    esac
}

# slowest TARGET: the seconds after which an input counts as one that hangs. 64 updates of 2000 boxes that all overlap take half a minute.
slowest() {
    [ "$1" = work_is_bounded ] && echo 300 || echo 60
}

# Targets that read files begin with fuzz/seeds; the corpus stays in fuzz/corpus. What fails lies in fuzz/artifacts: move it to
# fuzz/failed/TARGET, where the test suite runs it from then on.
run_fuzz() {
    local seconds=${1:-600} target words seeds
    shift || true
    [ $# -gt 0 ] || set -- finder_against_oracle between_against_oracle updates_against_scratch work_is_bounded decode \
        csv_reader npy_reader ply_reader obj_reader
    for target in "$@"; do
        words='' seeds=''
        mkdir -p "fuzz/corpus/$target"
        [ ! -d "fuzz/seeds/$target" ] || seeds="fuzz/seeds/$target"
        [ ! -f "fuzz/$target.dict" ] || words="-dict=fuzz/$target.dict"
        # Inputs of every length from the beginning: by itself libFuzzer stays below 30 bytes for minutes.
        step cargo +nightly fuzz run "$target" "fuzz/corpus/$target" $seeds -- -len_control=0 -max_total_time="$seconds" -max_len="$(longest "$target")" \
            -malloc_limit_mb=64 -timeout="$(slowest "$target")" -print_final_stats=1 $words
    done
}

setup=true
if [ "${1:-}" = --no-setup ]; then setup=false && shift; fi
name=${1:-}
declare -F "run_$name" >/dev/null || { sed -n '2,/^set/s/^# \{0,1\}//p' "$0" >&2 && exit 2; }
case $name in
wasm | aarch64 | windows) parts="rust $name" ;;
viewer | pictures) parts="rust vulkan $name" ;;
publish) parts="rust deny msrv semver" ;;
*) parts=rust ;;
esac
shift
if $setup; then scripts/setup.sh $parts || true; fi
. scripts/common.sh
"run_$name" "$@"
echo "== $name: done"
