#!/usr/bin/env bash
# Puts a patched copy of rapier3d 0.36.1 beside a project, so that pbig can find its pairs.
#
#     patch-rapier.sh [PROJECT]          makes PROJECT/patched/rapier3d-0.36.1 (PROJECT: the current folder)
#     patch-rapier.sh --undo [PROJECT]   removes it again
#
# It needs cargo and patch. The source comes from the registry that cargo uses. Run it again at any time: it starts over.
set -euo pipefail

version=0.36.1
patch_file="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)/patches/rapier3d+$version.patch"

fail() {
    echo "patch-rapier: $*" >&2
    exit 1
}

is_undo=false
if [ "${1:-}" = --undo ]; then
    is_undo=true
    shift
fi
project="${1:-.}"
[ -f "$project/Cargo.toml" ] || fail "no Cargo.toml in '$project': name the folder of your project"
project="$(cd "$project" && pwd)"
# The workspace, if there is one: cargo reads patches and versions there.
if manifest="$(cd "$project" && cargo locate-project --workspace --message-format plain 2>/dev/null)"; then
    project="$(dirname "$manifest")"
fi
copy="$project/patched/rapier3d-$version"

if $is_undo; then
    rm -rf "$copy"
    rmdir "$project/patched" 2>/dev/null || true
    cat <<TEXT
Removed $copy.
Remove from $project/Cargo.toml the line 'rapier3d = { path = ... }' under [patch.crates-io] and the dependency rapier-pbig,
and its use in the code.
TEXT
    exit 0
fi

command -v patch >/dev/null || fail "the program 'patch' is missing: install it (Debian: apt install patch)"
[ -f "$patch_file" ] || fail "$patch_file is missing: run the script from a copy of pbig's repository"

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
manifest="$(grep -oE '"manifest_path":"[^"]*/rapier3d(-'"$version"')?/Cargo.toml"' <<<"$metadata" | head -1 | cut -d'"' -f4)"
[ -f "$manifest" ] || fail "cargo has fetched no rapier3d $version"
# A configuration of cargo may replace rapier3d already, by the copy of the last run.
[ "$(dirname "$manifest")" != "$copy" ] ||
    fail "cargo's configuration takes rapier3d from $copy: move [patch.crates-io] into $project/Cargo.toml, or remove the copy by --undo"

# Made aside and moved into place, so that no half-patched copy stays behind.
rm -rf "$copy.new"
mkdir -p "$(dirname "$copy")"
cp -r "$(dirname "$manifest")" "$copy.new"
chmod -R u+w "$copy.new"
patch --quiet --forward --strip=1 --directory="$copy.new" <"$patch_file" ||
    fail "the patch does not apply to $(dirname "$manifest"): is it unchanged?"
rm -rf "$copy"
mv "$copy.new" "$copy"

cat <<TEXT
Made $copy.
Add to $project/Cargo.toml, unless it has them:

    [dependencies]
    rapier-pbig = { path = "$(dirname "$(dirname "$patch_file")")/rapier-0.36/rapier-pbig" }

    [patch.crates-io]
    rapier3d = { path = "patched/rapier3d-$version" }

In a workspace also: exclude = ["patched"]. Leave patched/ out of version control: this script makes it again.
TEXT
