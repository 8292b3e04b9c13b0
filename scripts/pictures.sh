#!/usr/bin/env bash
# Makes the pictures of the documents from a fixed seed: docs/images/falling.png, falling.webp and viewer.png.
#   scripts/pictures.sh [--no-setup]     it calls setup.sh first, unless told not to
# It needs no display; a software adapter will do. Times in the pictures are those of this machine, which should be idle.
set -euo pipefail
cd "$(dirname "$0")/.."
[ "${1:-}" = --no-setup ] || scripts/setup.sh rust vulkan pictures || true
. scripts/common.sh

{ has img2webp && has pngquant; } || { left_out "the pictures" && exit 0; }
images=docs/images
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cargo build --locked --release --manifest-path viewer/Cargo.toml
viewer=$(target_folder --manifest-path viewer/Cargo.toml)/release/viewer

# at_most BYTES FILE: fails if the file is larger.
at_most() {
    local bytes
    bytes=$(wc -c <"$2")
    echo "$2: $bytes bytes of at most $1"
    [ "$bytes" -le "$1" ]
}

mkdir -p "$images"
# One run makes both: pictures of every 8th step, of which one is the README's.
still=00168
step "$viewer" --scene column --bodies 10000 --seed 1 --compare --size 1440x720 --steps 240 --every 8 --frames "$work/falling"
pngquant --force --speed 1 --output "$images/falling.png" 256 "$work/falling/$still.png"
at_most 400000 "$images/falling.png"
# Each for the time of its 8 steps, in ms.
img2webp -loop 0 -lossy -q 45 -m 4 -d 133 "$work"/falling/*.png -o "$images/falling.webp"
at_most 3000000 "$images/falling.webp"

# Figures, the graph and contacts.
step "$viewer" --scene column --bodies 10000 --seed 1 --backend cpu --colour contacts --size 1280x800 \
    --steps 200 --every 200 --frames "$work/viewer"
pngquant --force --speed 1 --output "$images/viewer.png" 256 "$work/viewer/00200.png"
at_most 400000 "$images/viewer.png"
