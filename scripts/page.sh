#!/usr/bin/env bash
# Builds the web page of falling objects into a folder of static files, which any file server serves:
#   scripts/page.sh [--no-setup] [--test] [FOLDER]     FOLDER: out/page here; an earlier page there is replaced
#   python3 -m http.server -d out/page
# It calls setup.sh first, unless told not to. --test also runs the tests of the page, those in headless Chromium included;
# their screenshots go to out/page-shots. From clean it takes some minutes, most of them for Rust.
set -euo pipefail
caller=$PWD
cd "$(dirname "$0")/.."
setup=true test=false out=out/page
for argument in "$@"; do
    case $argument in
    --no-setup) setup=false ;;
    --test) test=true ;;
    -*) echo "there is no option '$argument'; the options: --no-setup --test" >&2 && exit 2 ;;
    /*) out=$argument ;;
    *) out=$caller/$argument ;;
    esac
done
target=wasm32-unknown-unknown
tools=page/node_modules/.bin
# The script that the module imports its device from.
device=--alias:pbig-page-device=./page/web/device.js

# timed TEXT COMMAND...: runs a command between two lines, of which the second says how long it took.
timed() {
    local text=$1 start=$SECONDS
    shift
    echo "== $text ..."
    "$@"
    echo "== $text: $((SECONDS - start)) s"
}

# check_folder: refuses a folder of other files than an earlier page's, because `bundle` deletes what is there.
check_folder() {
    if [ ! -e "$out" ] || [ -f "$out/pbig_page_bg.wasm" ]; then return; fi
    if [ ! -d "$out" ] || [ -n "$(ls -A "$out")" ]; then
        echo "'$out' is not a page that this script built; choose a folder that is empty or not there" >&2
        exit 2
    fi
}

# build_module PACKAGE FOLDER: a WebAssembly module, and the JavaScript beside it: rapier and pbig, or the GPU. The module
# has SIMD, and no unwinding. The program that writes the JavaScript is small: optimizing it would take longer than it runs.
build_module() {
    local package=$1 folder=$2
    RUSTFLAGS="-C target-feature=+simd128" timed "compile $package for browsers" "${cargo[@]}" build --locked --profile wasm --lib --package "$package" \
        --target "$target" --target-dir "$built/wasm"
    timed "write the JavaScript of $package" cargo run --locked --package pbig-page-bindgen -- "$built/wasm/$target/wasm/${package//-/_}.wasm" "$folder"
}

install_tools() {
    [ page/node_modules/.package-lock.json -nt page/package-lock.json ] ||
        (cd page && timed "install the page's tools" npm ci --no-audit --no-fund --ignore-scripts)
}

# bundle: everything that a browser loads, and the licences of what it contains.
bundle() {
    rm -rf "$out"
    mkdir -p "$out/licences"
    # First, because `check_folder` looks for it, also after a bundle that failed.
    cp "$built"/bindings/pbig_page{,_gpu}_bg.wasm "$out"
    # Splitting: what several scripts need, and what is loaded later, becomes files of their own.
    timed "bundle" "$tools/esbuild" page/web/{main,worker}.js page/web/style.css --bundle --splitting --minify --format=esm \
        --target=es2022 --log-level=warning --alias:pbig-page-module="$built/bindings/pbig_page.js" \
        --alias:pbig-page-gpu-module="$built/bindings/pbig_page_gpu.js" "$device" --outdir="$out"
    cp page/web/index.html page/web/start.js "$out"
    cp LICENSE-MIT LICENSE-APACHE "$out/licences"
    for package in three uplot wasm-feature-detect; do
        cp "page/node_modules/$package/LICENSE" "$out/licences/$package.txt"
    done
}

# test_page: the logic natively and in node, then the page in a browser, one test file after another; and the pairs of the native
# program, with which the module's are compared.
test_page() {
    timed "test the Rust of the page" cargo test --quiet --locked --release --package pbig-page
    timed "compile the native program" cargo build --quiet --locked --release --package pbig-page --bin native_pairs
    PAGE_FOLDER=$(cd "$out" && pwd) NATIVE_PAIRS=$built/release/native_pairs \
        CHROMIUM=$(command -v chromium) SHOTS=$PWD/out/page-shots \
        timed "test in node and Chromium" "$node" --test --test-reporter=spec --test-concurrency=1 page/tests/*.test.mjs
}

check_folder
parts="rust wasm page"
! $test || parts="$parts browser"
! $setup || scripts/setup.sh $parts || true
. scripts/common.sh
choose_cargo "$target" && has npm || { left_out "$target or npm" && exit 0; }
use_wasm_linker
built=$(target_folder)
build_module pbig-page "$built/bindings"
build_module pbig-page-gpu "$built/bindings"
install_tools
bundle
echo "== the page is in $out; serve it with: python3 -m http.server -d $out"
if $test; then
    has chromium || { left_out "the page's tests: there is no Chromium" && exit 0; }
    node=$(new_node) || { left_out "the page's tests, which need Node 22.12 or newer: this is $(node --version)" && exit 0; }
    test_page
    echo "== page: all passed"
fi
