#!/usr/bin/env bash
# Puts patched copies of rapier 0.36.1 beside a project, so that pbig can find its pairs.
#
#     patch-rapier.sh [PROJECT]                 makes PROJECT/patched/rapier3d-0.36.1 (PROJECT: the current folder)
#     patch-rapier.sh --crate NAME [PROJECT]    for this crate; once or more. Default: the crates of rapier in PROJECT's Cargo.lock,
#                                               else in its manifests, else rapier3d
#     patch-rapier.sh --edge-lookup [PROJECT]   also mends rapier's lookup of pairs: see patches/
#     patch-rapier.sh --undo [PROJECT]          removes the copies
#
# One patch serves rapier2d, rapier2d-f64, rapier3d and rapier3d-f64, whose sources are the same.
# It needs cargo and patch. The source comes from the registry that cargo uses. Run it again at any time: it starts over.
# In a workspace the copies belong to the root. Name the folder of the member that uses rapier to see the lines for its manifest.
set -euo pipefail

version=0.36.1
clone="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd -P)"
patches=("$clone/patches/rapier3d+$version.patch")

fail() {
    echo "patch-rapier: $*" >&2
    exit 1
}

is_undo=false
crates=
while [ $# -gt 0 ]; do
    case $1 in
    --undo) is_undo=true ;;
    --edge-lookup) patches+=("$clone/patches/rapier3d+$version-edge-lookup.patch") ;;
    --crate)
        case ${2:-} in rapier[23]d | rapier[23]d-f64) ;; *) fail "--crate needs rapier2d, rapier2d-f64, rapier3d or rapier3d-f64" ;; esac
        crates+=" $2" && shift
        ;;
    -*) fail "unknown option '$1': --undo, --edge-lookup or --crate" ;;
    *) break ;;
    esac
    shift
done
project="${1:-.}"
[ -f "$project/Cargo.toml" ] || fail "no Cargo.toml in '$project': name the folder of your project"
project="$(cd "$project" && pwd -P)"
member="$project"
# The workspace, if there is one: cargo reads patches and versions there. On Windows cargo writes backslashes.
if manifest="$(cd "$project" && cargo locate-project --workspace --message-format plain 2>/dev/null)"; then
    project="$(cd "$(dirname "${manifest//\\//}")" && pwd -P)"
fi

if $is_undo; then
    rm -rf "$project"/patched/rapier[23]d-"$version" "$project"/patched/rapier[23]d-f64-"$version"
    rmdir "$project/patched" 2>/dev/null || true
    cat <<TEXT
Removed the copies in $project/patched.
Remove from $project/Cargo.toml the lines of rapier under [patch.crates-io]. Remove the dependency on pbig's crate and its use in
the code.
TEXT
    exit 0
fi

# versions_of CRATE: its versions in the project's Cargo.lock.
versions_of() {
    [ ! -f "$project/Cargo.lock" ] ||
        awk -v wanted="\"$1\"" '$1 == "name" && $3 == wanted { getline; gsub(/"/, "", $3); print $3 }' "$project/Cargo.lock"
}

# manifests: the project's manifests, without those of pbig and of patched copies.
manifests() {
    ls "$project"/Cargo.toml "$project"/*/Cargo.toml "$project"/*/*/Cargo.toml 2>/dev/null |
        grep -vF -e "$clone/" -e "$project/patched/"
}

# find_crates: sets `crates` to the crates of rapier that the project has, at the patch's version where it has a lock file.
find_crates() {
    local crate other=
    for crate in rapier2d rapier2d-f64 rapier3d rapier3d-f64; do
        found="$(versions_of $crate)"
        # Another version would not be replaced by the patched one.
        case $'\n'$found$'\n' in
        *$'\n'"$version"$'\n'*) crates+=" $crate" ;;
        $'\n\n') ;;
        *) other="$crate ${found//$'\n'/, }" ;;
        esac
    done
    [ -n "$crates" ] || [ -z "$other" ] ||
        fail "$project/Cargo.lock has $other; the patch is for $version: change your dependency, or run" \
            "'cargo update -p ${other%% *} --precise $version'"
    [ -n "$crates" ] || crates="$(manifests | tr '\n' '\0' | xargs -0 grep -ohE '\b(bevy_)?rapier[23]d(-f64)?\b' |
        sed 's/^bevy_//' | sort -u)" || true
    crates=${crates:-rapier3d}
}
[ -n "$crates" ] || find_crates

command -v patch >/dev/null || fail "the program 'patch' is missing: install it (Debian: apt install patch)"
for file in "${patches[@]}"; do
    [ -f "$file" ] || fail "$file is missing: run the script from a copy of pbig's repository"
done

# A project of its own, so that a missing or wrong entry in the user's Cargo.toml is no obstacle.
work="$(mktemp -d)"
trap 'rm -rf "$work" "$project"/patched/rapier*.new' EXIT
mkdir -p "$work/src"
touch "$work/src/lib.rs"
cat >"$work/Cargo.toml" <<TOML
[package]
name = "fetch-rapier"
version = "0.0.0"
edition = "2021"
[dependencies]
$(for crate in $crates; do echo "$crate = \"=$version\""; done)
[workspace]
TOML
# Run in the project, whose configuration of cargo counts.
metadata="$(cd "$project" && cargo metadata --format-version 1 --manifest-path "$work/Cargo.toml")" ||
    fail "cargo cannot fetch" $crates "$version"

# make_copy CRATE: made aside and moved into place, so that no half-patched copy stays behind.
make_copy() {
    local copy="$project/patched/$1-$version" manifest origin file
    manifest="$(grep -oE '"manifest_path":"[^"]*/'"$1(-$version)?"'/Cargo.toml"' <<<"${metadata//\\\\//}" | head -1 | cut -d'"' -f4)"
    [ -f "$manifest" ] || fail "cargo has fetched no $1 $version"
    origin="$(cd "$(dirname "$manifest")" && pwd -P)"
    # A configuration of cargo may replace the crate already, by the copy of the last run.
    [ "$origin" != "$copy" ] ||
        fail "cargo's configuration takes $1 from $copy: move [patch.crates-io] into $project/Cargo.toml, or remove the copy by --undo"
    rm -rf "$copy.new"
    mkdir -p "$project/patched"
    cp -r "$origin" "$copy.new"
    chmod -R u+w "$copy.new"
    for file in "${patches[@]}"; do
        patch --quiet --forward --strip=1 --directory="$copy.new" <"$file" ||
            fail "the patch ${file##*/} does not apply to $origin: is it unchanged?"
    done
    rm -rf "$copy"
    mv "$copy.new" "$copy"
    echo "Made $copy."
}
for crate in $crates; do make_copy "$crate"; done

# lines_for FOLDER: the dependencies as FOLDER's manifest names them. Their paths are relative if the clone lies in the project.
lines_for() {
    local folder=$1 up= home crate
    case $clone in
    "$project"/*)
        while [ "${clone#"${folder%/}"/}" = "$clone" ]; do folder=$(dirname "$folder") up=../$up; done
        home="$up${clone#"${folder%/}"/}"
        ;;
    *) home=$clone ;;
    esac
    for crate in $crates; do echo "    $crate-pbig = { path = \"$home/rapier-0.36/$crate-pbig\" }"; done
}

# has_table NAME MANIFEST
has_table() { grep -qE "^[[:space:]]*\[$1[].]" "$2"; }

patch_lines="    [patch.crates-io]$(for crate in $crates; do printf '\n    %s = { path = "patched/%s-%s" }' "$crate" "$crate" "$version"; done)"
if has_table workspace "$project/Cargo.toml"; then
    excluded='"patched"'
    case $clone in "$project"/*) excluded="\"${clone#"$project"/}\", $excluded" ;; esac
    # From a virtual root: the first member that uses rapier, because such a root has no dependencies.
    if [ "$member" = "$project" ] && ! has_table package "$project/Cargo.toml"; then
        manifest="$(manifests | tr '\n' '\0' | xargs -0 grep -lE '^(\[.*dependencies\.)?(bevy_)?rapier[23]d' | head -1)" || true
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
$(lines_for "${member:-$project}")
TEXT
    [ -n "$member" ] || echo "    # A path that begins with no / is relative to the root: put ../ before it for each folder between."
else
    cat <<TEXT
Add to $project/Cargo.toml, unless it has them:

    [dependencies]
$(lines_for "$project")

$patch_lines
TEXT
fi
echo
echo "Leave patched/ out of version control: this script makes it again."
