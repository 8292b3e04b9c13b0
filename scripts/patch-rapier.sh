#!/usr/bin/env bash
# Puts a patched copy of rapier3d 0.36.1 beside a project, so that pbig can find its pairs.
#
#     patch-rapier.sh [PROJECT]                 makes PROJECT/patched/rapier3d-0.36.1 (PROJECT: the current folder)
#     patch-rapier.sh --edge-lookup [PROJECT]   also mends rapier's lookup of pairs: see patches/
#     patch-rapier.sh --undo [PROJECT]          removes the copy
#
# It needs cargo and patch. The source comes from the registry that cargo uses. Run it again at any time: it starts over.
# In a workspace the copy belongs to the root. Name the folder of the member that uses rapier to see the lines for its manifest.
set -euo pipefail

version=0.36.1
clone="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd -P)"
patches=("$clone/patches/rapier3d+$version.patch")

fail() {
    echo "patch-rapier: $*" >&2
    exit 1
}

is_undo=false
case "${1:-}" in
--undo) is_undo=true && shift ;;
--edge-lookup) patches+=("$clone/patches/rapier3d+$version-edge-lookup.patch") && shift ;;
-*) fail "unknown option '$1': --undo or --edge-lookup" ;;
esac
project="${1:-.}"
[ -f "$project/Cargo.toml" ] || fail "no Cargo.toml in '$project': name the folder of your project"
project="$(cd "$project" && pwd -P)"
member="$project"
# The workspace, if there is one: cargo reads patches and versions there. On Windows cargo writes backslashes.
if manifest="$(cd "$project" && cargo locate-project --workspace --message-format plain 2>/dev/null)"; then
    project="$(cd "$(dirname "${manifest//\\//}")" && pwd -P)"
fi
copy="$project/patched/rapier3d-$version"

if $is_undo; then
    rm -rf "$copy"
    rmdir "$project/patched" 2>/dev/null || true
    cat <<TEXT
Removed $copy.
Remove from $project/Cargo.toml the line 'rapier3d = { path = ... }' under [patch.crates-io]. Remove the dependency rapier-pbig
and its use in the code.
TEXT
    exit 0
fi

command -v patch >/dev/null || fail "the program 'patch' is missing: install it (Debian: apt install patch)"
for file in "${patches[@]}"; do
    [ -f "$file" ] || fail "$file is missing: run the script from a copy of pbig's repository"
done

# What the project has now: another version would not be replaced by the patched one.
if [ -f "$project/Cargo.lock" ]; then
    found="$(awk '$1 == "name" && $3 == "\"rapier3d\"" { getline; gsub(/"/, "", $3); print $3 }' "$project/Cargo.lock")"
    newline=$'\n'
    case $newline$found$newline in
    *"$newline$version$newline"* | "$newline$newline") ;;
    *) fail "$project/Cargo.lock has rapier3d ${found//$newline/, }; the patch is for $version: change your dependency, or run" \
        "'cargo update -p rapier3d --precise $version'" ;;
    esac
fi

# A project of its own, so that a missing or wrong entry in the user's Cargo.toml is no obstacle.
work="$(mktemp -d)"
trap 'rm -rf "$work" "$copy.new"' EXIT
mkdir -p "$work/src"
touch "$work/src/lib.rs"
cat >"$work/Cargo.toml" <<TOML
[package]
name = "fetch-rapier"
version = "0.0.0"
edition = "2021"
[dependencies]
rapier3d = "=$version"
[workspace]
TOML
# Run in the project, whose configuration of cargo counts.
metadata="$(cd "$project" && cargo metadata --format-version 1 --manifest-path "$work/Cargo.toml")" ||
    fail "cargo cannot fetch rapier3d $version"
manifest="$(grep -oE '"manifest_path":"[^"]*/rapier3d(-'"$version"')?/Cargo.toml"' <<<"${metadata//\\\\//}" | head -1 | cut -d'"' -f4)"
[ -f "$manifest" ] || fail "cargo has fetched no rapier3d $version"
origin="$(cd "$(dirname "$manifest")" && pwd -P)"
# A configuration of cargo may replace rapier3d already, by the copy of the last run.
[ "$origin" != "$copy" ] ||
    fail "cargo's configuration takes rapier3d from $copy: move [patch.crates-io] into $project/Cargo.toml, or remove the copy by --undo"

# Made aside and moved into place, so that no half-patched copy stays behind.
rm -rf "$copy.new"
mkdir -p "$(dirname "$copy")"
cp -r "$origin" "$copy.new"
chmod -R u+w "$copy.new"
for file in "${patches[@]}"; do
    patch --quiet --forward --strip=1 --directory="$copy.new" <"$file" ||
        fail "the patch ${file##*/} does not apply to $origin: is it unchanged?"
done
rm -rf "$copy"
mv "$copy.new" "$copy"

# path_from FOLDER: the path of rapier-pbig as FOLDER's manifest names it. It is relative if the clone lies in the project.
path_from() {
    local folder=$1 up=
    case $clone in "$project"/*) ;; *) echo "$clone/rapier-0.36/rapier-pbig" && return ;; esac
    while [ "${clone#"${folder%/}"/}" = "$clone" ]; do folder=$(dirname "$folder") up=../$up; done
    echo "$up${clone#"${folder%/}"/}/rapier-0.36/rapier-pbig"
}

# has_table NAME MANIFEST
has_table() { grep -qE "^[[:space:]]*\[$1[].]" "$2"; }

echo "Made $copy."
patch_lines="    [patch.crates-io]
    rapier3d = { path = \"patched/rapier3d-$version\" }"
if has_table workspace "$project/Cargo.toml"; then
    excluded='"patched"'
    case $clone in "$project"/*) excluded="\"${clone#"$project"/}\", $excluded" ;; esac
    # From a virtual root: the first member that uses rapier, because such a root has no dependencies.
    if [ "$member" = "$project" ] && ! has_table package "$project/Cargo.toml"; then
        manifest="$(grep -lE '^(\[.*dependencies\.)?(bevy_)?rapier3d' "$project"/*/Cargo.toml "$project"/*/*/Cargo.toml 2>/dev/null |
            grep -vF -e "$clone/" -e "$project/patched/" | head -1)" || true
        member="${manifest%/Cargo.toml}"
    else
        manifest="$member/Cargo.toml"
    fi
    cat <<TEXT
Add to $project/Cargo.toml, the root of the workspace, unless it has them:

    [workspace]
    exclude = [$excluded]

$patch_lines

Add to ${manifest:-the Cargo.toml of the member that uses rapier}:

    [dependencies]
    rapier-pbig = { path = "$(path_from "${member:-$project}")" }
TEXT
    [ -n "$member" ] || echo "    # A path that begins with no / is relative to the root: put ../ before it for each folder between."
else
    cat <<TEXT
Add to $project/Cargo.toml, unless it has them:

    [dependencies]
    rapier-pbig = { path = "$(path_from "$project")" }

$patch_lines
TEXT
fi
echo
echo "Leave patched/ out of version control: this script makes it again."
