#!/usr/bin/env bash
# Tests scripts/patch-rapier.sh in a project of its own: what it makes, what it removes, and what it says when something is wrong.
set -euo pipefail
root="$(cd "$(dirname "$0")/.." && pwd -P)"
script="$root/scripts/patch-rapier.sh"
work="$(cd "$(mktemp -d)" && pwd -P)"
trap 'rm -rf "$work"' EXIT
project="$work/a project"
copy="$project/patched/rapier3d-0.36.1"

# fails_with TEXT ARGUMENT...: the script fails, and says so.
fails_with() {
    local text=$1 said
    shift
    if said=$("$script" "$@" 2>&1); then echo "it succeeds: $*" && exit 1; fi
    case $said in *"$text"*) ;; *) echo "it says: $said" && exit 1 ;; esac
    [ ! -e "$copy" ] && [ ! -e "$copy.new" ] || { echo "a copy stays behind" && exit 1; }
}

# prints TEXT ARGUMENT...: the script succeeds, and prints these lines among others.
prints() {
    local text=$1 said
    shift
    said=$("$script" "$@")
    case $said in *"$text"*) ;; *) echo "it says: $said; not: $text" && exit 1 ;; esac
}

fails_with "no Cargo.toml in '$project'" "$project"
fails_with "unknown option '--fast'" --fast "$project"
mkdir "$project"
touch "$project/Cargo.toml"
printf '[[package]]\nname = "rapier3d"\nversion = "0.30.0"\n' >"$project/Cargo.lock"
fails_with "Cargo.lock has rapier3d 0.30.0; the patch is for 0.36.1" "$project"
printf '[[package]]\nname = "rapier3d"\nversion = "0.27.0"\n[[package]]\nname = "rapier3d"\nversion = "0.36.1"\n' \
    >"$project/Cargo.lock"
"$script" "$project" >/dev/null
rm -r "$project/patched" "$project/Cargo.lock"
# Beside another patch, as one of an older version would be.
mkdir -p "$work/old/scripts" "$work/old/patches"
cp "$script" "$work/old/scripts/"
patch="rapier3d+0.36.1.patch"
sed 's/^ [a-z].*/ no such line/' "$(dirname "$script")/../patches/$patch" >"$work/old/patches/$patch"
script="$work/old/scripts/patch-rapier.sh" fails_with "the patch $patch does not apply" "$project"
rm "$work/old/patches/"*
script="$work/old/scripts/patch-rapier.sh" fails_with "run the script from a copy of pbig's repository" "$project"

# Twice, then undone; other things in the folder stay.
(cd "$project" && "$script" >/dev/null)
touch "$copy/left-from-before"
"$script" --edge-lookup "$project" >/dev/null
grep -q find_edge_visiting "$copy/src/data/graph.rs"
"$script" "$project" >/dev/null
grep -q PairFinder "$copy/src/geometry/broad_phase_bvh/pair_finder.rs"
! grep -q find_edge_visiting "$copy/src/data/graph.rs" || { echo "the lookup is patched unasked" && exit 1; }
[ ! -e "$copy/left-from-before" ]
touch "$project/patched/mine"
"$script" --undo "$project" >/dev/null
[ ! -e "$copy" ] && [ -e "$project/patched/mine" ]
rm "$project/patched/mine"
# In a plain package, with the clone outside and in it.
printf '[package]\nname = "plain"\nversion = "0.0.0"\n' >"$project/Cargo.toml"
mkdir "$project/src"
touch "$project/src/lib.rs"
prints "path = \"$root/rapier-0.36/rapier-pbig\"" "$project"
clone="$project/third party/pbig"
mkdir -p "$clone/scripts" "$clone/patches"
cp "$script" "$clone/scripts/"
cp "$root/patches/"* "$clone/patches/"
script="$clone/scripts/patch-rapier.sh"
prints "Add to $project/Cargo.toml, unless it has them:

    [dependencies]
    rapier-pbig = { path = \"third party/pbig/rapier-0.36/rapier-pbig\" }

    [patch.crates-io]
    rapier3d = { path = \"patched/rapier3d-0.36.1\" }
" "$project"
# In a virtual workspace, named by its member: the copy belongs to the root, which says what to leave out.
rm -r "$project/src" "$project/patched"
mkdir -p "$project/crates/app/src" "$project/crates/aaa"
printf '[workspace]\nmembers = ["crates/app"]\n' >"$project/Cargo.toml"
printf '[package]\nname = "app"\nversion = "0.0.0"\n[dependencies]\nrapier3d = "0.36"\n' >"$project/crates/app/Cargo.toml"
printf '[package]\nname = "aaa"\n' >"$project/crates/aaa/Cargo.toml"
touch "$project/crates/app/src/lib.rs"
lines="Add to $project/Cargo.toml, the root of the workspace, unless it has them:

    [workspace]
    exclude = [\"third party/pbig\", \"patched\"]

    [patch.crates-io]
    rapier3d = { path = \"patched/rapier3d-0.36.1\" }

Add to $project/crates/app/Cargo.toml:

    [dependencies]
    rapier-pbig = { path = \"../../third party/pbig/rapier-0.36/rapier-pbig\" }
"
prints "$lines" "$project/crates/app"
[ -e "$copy" ] && [ ! -e "$project/crates/app/patched" ]
# Named by its root: the script finds the member that uses rapier.
prints "$lines" "$project"
printf '[package]\nname = "app"\nversion = "0.0.0"\n' >"$project/crates/app/Cargo.toml"
prints "Add to the Cargo.toml of the member that uses rapier:" "$project"
# A root that is a package as well.
printf '[package]\nname = "top"\nversion = "0.0.0"\n[lib]\npath = "crates/app/src/lib.rs"\n[workspace]\n' >"$project/Cargo.toml"
prints "Add to $project/Cargo.toml:

    [dependencies]
    rapier-pbig = { path = \"third party/pbig/rapier-0.36/rapier-pbig\" }
" "$project"
"$script" --undo "$project" >/dev/null
[ ! -e "$project/patched" ]
echo "patch-rapier.sh: all as it should be"
