#!/usr/bin/env bash
# Tests scripts/patch-rapier.sh in a project of its own: what it makes, what it removes, and what it says when something is wrong.
set -euo pipefail
script="$(cd "$(dirname "$0")" && pwd)/patch-rapier.sh"
work="$(mktemp -d)"
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

fails_with "no Cargo.toml in '$project'" "$project"
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
script="$work/old/scripts/patch-rapier.sh" fails_with "the patch does not apply" "$project"
rm "$work/old/patches/"*
script="$work/old/scripts/patch-rapier.sh" fails_with "run the script from a copy of pbig's repository" "$project"

# Twice, then undone; other things in the folder stay.
(cd "$project" && "$script" >/dev/null)
touch "$copy/left-from-before"
"$script" "$project" >/dev/null
grep -q PairFinder "$copy/src/geometry/broad_phase_bvh/pair_finder.rs"
[ ! -e "$copy/left-from-before" ]
touch "$project/patched/mine"
"$script" --undo "$project" >/dev/null
[ ! -e "$copy" ] && [ -e "$project/patched/mine" ]
rm "$project/patched/mine"
# From a member of a workspace: the copy and what is said belong to the workspace.
mkdir -p "$project/crates/app/src"
printf '[workspace]\nmembers = ["crates/app"]\nexclude = ["patched"]\n' >"$project/Cargo.toml"
printf '[package]\nname = "app"\nversion = "0.0.0"\n' >"$project/crates/app/Cargo.toml"
touch "$project/crates/app/src/lib.rs"
case $(cd "$project/crates/app" && "$script") in *"Add to $project/Cargo.toml"*) ;; *) exit 1 ;; esac
[ -e "$copy" ] && [ ! -e "$project/crates/app/patched" ]
"$script" --undo "$project" >/dev/null
[ ! -e "$project/patched" ]
echo "patch-rapier.sh: all as it should be"
