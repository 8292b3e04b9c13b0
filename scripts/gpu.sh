#!/usr/bin/env bash
# Tests the kernels on drivers and compilers beside the machine's own, none of which needs a GPU, and on its own.
#   scripts/gpu.sh [--no-setup] [NAME...]     without a name: all
#   swiftshader   the suite's GPU part on SwiftShader, the Vulkan driver in Chromium
#   dawn          the pipeline on Dawn under node, also with workgroups and lanes in other orders
#   chromium      the same in headless Chromium
#   fxc           Microsoft's compiler for DirectX, under wine: at most 5 seconds for each text
#   amd           AMD's compiler in Mesa: registers, waves and spills of each kernel; nothing may spill
#   validation    the suite's GPU part under Khronos' validation layer: no message
#   device        the suite's GPU part and every GPU benchmark on this machine's adapter, in at most eight minutes after the build.
#                 The tables go to out/gpu/device; a software adapter runs small sizes. It runs only if it is named.
# What lacks a tool is left out by name.
set -euo pipefail
cd "$(dirname "$0")/.."
. scripts/common.sh
out=$PWD/out/gpu
compilers=shaders/tests/compilers
suite="cargo test --release --test suite -- kernels:: gpu::"

# needs WHAT COMMAND...: returns false, and says so, if a command or file is missing.
needs() {
    local what=$1 needed
    shift
    for needed in "$@"; do
        has "$needed" || [ -e "$needed" ] || { echo "== left out: $what, which needs $needed" && return 1; }
    done
}

# driver NAME: prints the file of a Vulkan driver.
driver() {
    local file
    for file in /usr/share/vulkan/icd.d/*"$1"*.json /usr/lib/chromium/*"$1"*.json; do
        [ ! -f "$file" ] || { echo "$file" && return; }
    done
    echo "no-driver-$1"
}

# texts: writes each kernel in SPIR-V and HLSL to out/gpu/texts.
texts() {
    rm -rf "$out/texts"
    mkdir -p "$out/texts"
    PBIG_TEXTS=$out/texts step cargo test --quiet --release --test valid translate::
}

# expect PATTERN FILE: fails, and shows the file, unless a line of it has the pattern.
expect() {
    grep -q "$1" "$2" || { cat "$2" && echo "there is no '$1'" && return 1; }
}

run_swiftshader() {
    local file
    file=$(driver swiftshader)
    needs SwiftShader "$file" || return 0
    export VK_DRIVER_FILES=$file
    step cargo run --quiet --release --bin pbig -- doctor >"$out/doctor"
    expect SwiftShader "$out/doctor"
    # One thread: it compiles a kernel at its first dispatch, for seconds, which count as waiting for the device.
    step $suite --test-threads=1
    step cargo run --release --bin pbig -- simulate --scene pile --check --backend gpu --bodies 1500 --steps 20
}

install_dawn() {
    [ wasm/gpu/node_modules/.package-lock.json -nt wasm/gpu/package-lock.json ] ||
        (cd wasm/gpu && step npm ci --no-audit --no-fund --ignore-scripts)
}

# build_module: the pipeline as WebAssembly, and the JavaScript beside it.
build_module() {
    local target=wasm32-unknown-unknown built
    choose_cargo "$target" || return 1
    use_wasm_linker
    built=$(target_folder)/wasm
    step "${cargo[@]}" build --locked --profile wasm --lib --package pbig-page-gpu --features corpus --target "$target" --target-dir "$built"
    step cargo run --quiet --locked --package pbig-page-bindgen -- "$built/$target/wasm/pbig_page_gpu.wasm" "$out/module"
    mv "$out/module/pbig_page_gpu.js" "$out/module/pbig_page_gpu.mjs"
}

# Dawn takes SwiftShader: lavapipe of Mesa 22 lacks what it asks for.
run_dawn() {
    local file
    file=$(driver swiftshader)
    needs Dawn "$file" node npm || return 0
    install_dawn
    build_module
    step env VK_DRIVER_FILES="$file" timeout 2h node wasm/gpu/run.mjs "$out/module"
}

run_chromium() {
    needs Chromium chromium node || return 0
    build_module
    # A panic of the module can leave the page waiting.
    step timeout --foreground 1h node wasm/gpu/run.mjs "$out/module" chromium
}

# compile TEXT KERNEL: prints the seconds that FXC takes, and fails if they exceed the limit.
compile() {
    local seconds
    # A program for Windows ends its lines by two characters.
    seconds=$(timeout 300 wine "$out/fxc.exe" "$1" "$2" | tr -d '\r') || { echo "FXC does not compile $1 within 300 s" >&2 && return 1; }
    printf '%s\n' "$seconds"
    awk -v seconds="$seconds" 'BEGIN { exit seconds > 5 }' || { echo "FXC takes $seconds s for $1" >&2 && return 1; }
}

run_fxc() {
    local text kernel rest seconds faults=0
    needs FXC wine x86_64-w64-mingw32-gcc npm || return 0
    install_dawn
    texts
    export WINEPREFIX=$out/wine WINEDEBUG=-all WINEDLLOVERRIDES='d3dcompiler_47=n;mscoree,mshtml='
    x86_64-w64-mingw32-gcc -O1 -o "$out/fxc.exe" "$compilers/fxc.c" -ld3dcompiler_47
    cp wasm/gpu/node_modules/webgpu/dist/win32-x64/d3dcompiler_47.dll "$out"
    echo kernel,seconds >"$out/fxc.csv"
    for text in "$out"/texts/*.hlsl; do
        IFS=. read -r kernel rest <<<"${text##*/}"
        seconds=$(compile "$text" "$kernel") || faults=$((faults + 1))
        echo "$kernel,$seconds" >>"$out/fxc.csv"
    done
    cat "$out/fxc.csv"
    [ "$faults" = 0 ]
}

# statistic NAME: prints a value of the statistics in a file.
statistic() {
    sed -n "s/^$1,//p" "$out/statistics.txt"
}

run_amd() {
    local text kernel bindings rest file
    file=$(driver radeon)
    needs "AMD's compiler" "$file" cc /usr/include/vulkan/vulkan.h || return 0
    texts
    cc -O1 -o "$out/statistics" "$compilers/statistics.c" -lvulkan
    # Without a device the driver compiles for the family that is named: RDNA 2, as in Radeon RX 6800.
    export VK_DRIVER_FILES=$file RADV_FORCE_FAMILY=navi21
    echo kernel,vgprs,sgprs,spilled,waves,shared_bytes,code_bytes,cycles >"$out/amd.csv"
    for text in "$out"/texts/*.spv; do
        IFS=. read -r kernel bindings rest <<<"${text##*/}"
        "$out/statistics" "$text" "$kernel" "$bindings" >"$out/statistics.txt"
        echo "$kernel,$(statistic VGPRs),$(statistic 'Pre-Sched SGPRs'),$(($(statistic 'Spilled SGPRs') + \
            $(statistic 'Spilled VGPRs'))),$(statistic 'Subgroups per SIMD'),$(statistic 'LDS size'),$(statistic \
            'Code size'),$(statistic 'Inverse Throughput')" >>"$out/amd.csv"
    done
    cat "$out/amd.csv"
    awk -F, 'NR > 1 && $4 != 0 { print $1 " spills registers"; faults++ } END { exit faults > 0 }' "$out/amd.csv"
}

# validated CHECKS COMMAND...: runs a command under the validation layer, and fails if the layer has to say something.
validated() {
    local checks=$1
    shift
    rm -f "$out/layer.log"
    cat >"$out/vk_layer_settings.txt" <<SETTINGS
khronos_validation.enables = $checks
khronos_validation.report_flags = error,warn,perf,info
khronos_validation.debug_action = VK_DBG_LAYER_ACTION_LOG_MSG
khronos_validation.log_filename = $out/layer.log
SETTINGS
    VK_LAYER_SETTINGS_PATH=$out/vk_layer_settings.txt VK_INSTANCE_LAYERS=VK_LAYER_KHRONOS_validation step "$@"
    expect 'Khronos Validation Layer Active' "$out/layer.log"
    ! grep -E 'Validation (Error|Warning|Performance Warning)' "$out/layer.log"
}

run_validation() {
    local enable=VK_VALIDATION_FEATURE_ENABLE
    if ! needs "validation of Vulkan" /usr/share/vulkan/explicit_layer.d/VkLayer_khronos_validation.json; then
        step $suite
        return
    fi
    # A message that is known to come: wgpu asks for an extension that Vulkan 1.1 has.
    ! validated ${enable}_BEST_PRACTICES_EXT $suite kernels::arrange_dispatches_nothing_without_capacity --exact >/dev/null ||
        { echo "the layer is silent" && return 1; }
    # One thread: the layer once crashed where several made devices.
    validated ${enable}_SYNCHRONIZATION_VALIDATION_EXT $suite --test-threads=1
}

# Seconds for all that `device` measures and tests, and the packages that do.
device_seconds=480
device_packages="-p pbig-cli -p pbig-studies -p pbig-examples -p pbig-tests"

# on_device NAME COMMAND...: runs a command in what is left of the time, and notes its seconds and its status.
on_device() {
    local name=$1 start=$SECONDS status=0
    shift
    step timeout $((device_seconds - SECONDS > 1 ? device_seconds - SECONDS : 1)) "$@" >"$out/device/$name.log" 2>&1 || status=$?
    echo "$name,$((SECONDS - start)),$status" | tee -a "$out/device/steps.csv"
    [ "$status" = 0 ] || faults=$((faults + 1))
}

run_device() {
    local programs quick=() tests=(kernels:: gpu::) faults=0
    programs=$(target_folder)/release
    # One choice of packages, which is one set of features: every crate is built once.
    step cargo build --release $device_packages --bins --example resident
    step cargo test --release $device_packages --test suite --no-run
    rm -rf "$out/device" && mkdir -p "$out/device"
    "$programs/pbig" doctor >"$out/device/doctor.txt"
    # A software adapter takes minutes for all tests.
    ! grep -q '(software' "$out/device/doctor.txt" || quick=(--quick) tests=(gpu::resident)
    echo step,seconds,status >"$out/device/steps.csv"
    SECONDS=0
    on_device resident "$programs/examples/resident"
    on_device bench "$programs/pbig" bench gpu "${quick[@]}" --write "$out/device"
    on_device papers_quick "$programs/pbig-studies" papers --quick --write "$out/device"
    on_device suite cargo test --release $device_packages --test suite -- "${tests[@]}"
    [ ${#quick[@]} -gt 0 ] || on_device papers "$programs/pbig-studies" papers --write "$out/device"
    [ "$faults" = 0 ]
}

setup=true
if [ "${1:-}" = --no-setup ]; then setup=false && shift; fi
[ $# -gt 0 ] || set -- swiftshader dawn chromium fxc amd validation
if $setup; then scripts/setup.sh rust vulkan wasm page layers drivers || true; fi
mkdir -p "$out"
for name in "$@"; do
    declare -F "run_$name" >/dev/null || { sed -n '2,/^set/s/^# \{0,1\}//p' "$0" >&2 && exit 2; }
    # A shell of its own, for its variables.
    (set -e && "run_$name")
    echo "== $name: done"
done
