#!/usr/bin/env bash
# Puts patched copies of rapier 0.36.1 beside a project, so that pbig can find its pairs.
#
#     patch-rapier.sh [PROJECT]                 makes PROJECT/patched/rapier3d-0.36.1 (PROJECT: the current folder)
#     patch-rapier.sh --crate NAME [PROJECT]    for this crate; once or more. Default: the crates of rapier in PROJECT's Cargo.lock,
#                                               else in its manifests
#     patch-rapier.sh --edge-lookup [PROJECT]   also mends rapier's lookup of pairs: see patches/
#     patch-rapier.sh --undo [PROJECT]          removes the copies, and prints the lines to remove
#     patch-rapier.sh --help                    prints this text
#
# One patch serves rapier2d, rapier2d-f64, rapier3d and rapier3d-f64, whose sources are the same.
# It needs cargo and patch. The source comes from the registry that cargo uses. Run it again at any time: it starts over.
# In a workspace the copies belong to the root. PROJECT may be its folder or that of any member. Other versions of rapier are refused.
set -euo pipefail

version=0.36.1
clone="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd -P)"
patches=("$clone/patches/rapier3d+$version.patch")

fail() {
    echo "patch-rapier: $*" >&2
    exit 1
}

# show_help: the comment at the beginning of this file.
show_help() { sed -n '2,/^set /{s/^# \{0,1\}//p;}' "${BASH_SOURCE[0]}"; }

is_undo=false
crates=
while [ $# -gt 0 ]; do
    case $1 in
    --help | -h) show_help && exit 0 ;;
    --undo) is_undo=true ;;
    --edge-lookup) patches+=("$clone/patches/rapier3d+$version-edge-lookup.patch") ;;
    --crate)
        case ${2:-} in rapier[23]d | rapier[23]d-f64) ;; *) fail "--crate needs rapier2d, rapier2d-f64, rapier3d or rapier3d-f64" ;; esac
        crates+=" $2" && shift
        ;;
    -*) fail "unknown option '$1': --crate NAME, --edge-lookup, --undo or --help" ;;
    *) break ;;
    esac
    shift
done
[ $# -lt 2 ] || fail "'$2' after the folder '$1': options go before it"
project="${1:-.}"
[ -f "$project/Cargo.toml" ] || fail "no Cargo.toml in '$project': name the folder of your project"
project="$(cd "$project" && pwd -P)"
# The workspace, if there is one: cargo reads patches and versions there. On Windows cargo writes backslashes.
if manifest="$(cd "$project" && cargo locate-project --workspace --message-format plain 2>/dev/null)"; then
    project="$(cd "$(dirname "${manifest//\\//}")" && pwd -P)"
fi

# Neither rapier nor the patched copies need to be there yet: this reads manifests alone.
read_manifests() { (cd "$project" && cargo metadata --no-deps --format-version 1); }
about="$(read_manifests 2>/dev/null)" || about=

# is_own MANIFEST: pbig's, if the clone lies in the project, or a patched copy's.
is_own() {
    case $1 in
    "$project"/patched/*) ;;
    "$clone"/*) case $clone in "$project"/*) ;; *) return 1 ;; esac ;;
    *) return 1 ;;
    esac
}

# uses_of_rapier: a line "CRATE REQUIREMENT<tab>MANIFEST" for each dependency of a member on rapier or bevy_rapier.
uses_of_rapier() {
    local use manifest
    grep -oE '"name":"(bevy_)?rapier[23]d(-f64)?","source":[^,]*,"req":"[^"]*"|"manifest_path":"[^"]*"' <<<"${about//\\\\//}" |
        awk -F'"' '$2 == "name" { uses[n++] = $4 " " $(NF - 1) }
            $2 == "manifest_path" { for (i = 0; i < n; i++) print uses[i] "\t" $4; n = 0 }' | sort -u |
        while IFS=$'\t' read -r use manifest; do is_own "$manifest" || printf '%s\t%s\n' "$use" "$manifest"; done
}
uses="$(uses_of_rapier)" || true

# takes_patch CRATE REQUIREMENT: returns 1 if the requirement is of another version. Cargo decides about ranges.
takes_patch() {
    case "$1 $2" in
    bevy_*' '[=^~]0.37* | rapier*' '[=^~]0.36 | rapier*' '[~^]0.36.0 | rapier*' '[=^~]0.36.1 | *[*,\<\>]*) ;;
    *) return 1 ;;
    esac
}

# crates_of MANIFEST: the crates of rapier, among those to patch, that a member uses.
crates_of() {
    local use manifest name
    while IFS=$'\t' read -r use manifest; do
        name=${use%% *}
        [ "$manifest" = "$1" ] && takes_patch "$name" "${use#* }" || continue
        case " $crates " in *" ${name#bevy_} "*) echo "${name#bevy_}" ;; esac
    done <<<"$uses" | sort -u
}

# users: the manifests of the members that use a crate to patch.
users() {
    local manifest
    cut -f 2 <<<"$uses" | sort -u | while read -r manifest; do [ -z "$(crates_of "$manifest")" ] || echo "$manifest"; done
}

# members: the manifests of the project.
members() { { echo "$project/Cargo.toml" && grep -oE '"manifest_path":"[^"]*"' <<<"${about//\\\\//}" | cut -d'"' -f4; } | sort -u; }

# lines_to_remove: a line "FILE:NUMBER:TEXT" for each line of a manifest that names pbig's crates or a patched copy.
lines_to_remove() {
    members | while read -r manifest; do
        is_own "$manifest" || grep -HnE 'rapier[23]d(-f64)?-pbig|patched/rapier[23]d|exclude.*"patched"' "$manifest" || true
    done
}

if $is_undo; then
    did="There were no copies in $project/patched."
    ! compgen -G "$project/patched/rapier[23]d*-$version" >/dev/null || did="Removed the copies in $project/patched."
    rm -rf "$project"/patched/rapier[23]d-"$version" "$project"/patched/rapier[23]d-f64-"$version"
    rmdir "$project/patched" 2>/dev/null || true
    lines="$(lines_to_remove)" || true
    [ -n "$lines" ] || lines="(no manifest names pbig's crates or a copy)"
    cat <<TEXT
$did
Remove pbig's calls from the code, and these lines from the manifests, with [patch.crates-io] if nothing is left in it; take Cargo.lock back
from version control, so that cargo chooses no newer rapier:

$lines
TEXT
    exit 0
fi

# versions_of CRATE: its versions in the project's Cargo.lock.
versions_of() {
    [ ! -f "$project/Cargo.lock" ] ||
        awk -v wanted="\"$1\"" '$1 == "name" && $3 == wanted { getline; gsub(/"/, "", $3); print $3 }' "$project/Cargo.lock"
}

# is_locked CRATE: Cargo.lock has the patch's version. Returns 1 if it has another, which would not be replaced; sets `other` to it.
is_locked() {
    local found
    found="$(versions_of "$1")"
    case $'\n'$found$'\n' in
    *$'\n'"$version"$'\n'*) return 0 ;;
    $'\n\n') ;;
    *)
        other="$project/Cargo.lock has $1 ${found//$'\n'/, }"
        cure=". If it is $version there, run 'cargo update -p $1 --precise $version'"
        ;;
    esac
    return 1
}

# check_other: fails if another version was found.
check_other() {
    case $other in
    '') return 0 ;;
    *rapier3d*0.27*) cure=". Rapier3d 0.27 needs no patch: use pbig's crate rapier-pbig, without this script" ;;
    esac
    fail "$other; the patch is for $version (bevy_rapier 0.37): change the version in your manifest$cure"
}

# is_wanted CRATE: returns 1 if manifests ask for the crate, and none for the patch's version; sets `other` to what one asks for.
is_wanted() {
    local use manifest asked=
    while IFS=$'\t' read -r use manifest; do
        case ${use%% *} in "$1" | "bevy_$1") ;; *) continue ;; esac
        ! takes_patch "${use%% *}" "${use#* }" || return 0
        asked="$manifest asks for $use"
    done <<<"$uses"
    [ -n "$asked" ] || return 0
    other=$asked
    return 1
}

# find_crates: sets `crates` to the crates of rapier that the project has at the patch's version, in Cargo.lock or else in manifests.
find_crates() {
    local crate use manifest
    for crate in rapier2d rapier2d-f64 rapier3d rapier3d-f64; do
        ! is_locked $crate || crates+=" $crate"
    done
    # A manifest may have moved to another version since Cargo.lock was written.
    for crate in $crates; do is_wanted "$crate" || check_other; done
    [ -z "$crates" ] || return 0
    check_other
    [ -n "$about" ] || fail "mend the manifest, or name rapier's crate by --crate: $(read_manifests 2>&1 || true)"
    [ -n "$uses" ] || fail "nothing in $project depends on rapier: run 'cargo add rapier3d@$version' (or rapier2d, with or" \
        "without -f64) in the package that needs it, or name a crate by --crate"
    while IFS=$'\t' read -r use manifest; do
        crate=${use%% *}
        if takes_patch "$crate" "${use#* }"; then crates+=" ${crate#bevy_}"; else other="$manifest asks for $use"; fi
    done <<<"$uses"
    [ -n "$crates" ] || check_other
}
other='' cure=''
if [ -n "$crates" ]; then
    for crate in $crates; do is_locked "$crate" || check_other; done
else
    find_crates
fi
crates="$(tr ' ' '\n' <<<"$crates" | sort -u | xargs)"

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
metadata="$(cd "$project" && cargo metadata --quiet --format-version 1 --manifest-path "$work/Cargo.toml")" ||
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
    # One with new times would be compiled again.
    if diff -rq "$copy.new" "$copy" >/dev/null 2>&1; then
        rm -rf "$copy.new"
        echo "$copy is as it should be."
        return 0
    fi
    rm -rf "$copy"
    mv "$copy.new" "$copy"
    echo "Made $copy."
}
for crate in $crates; do make_copy "$crate"; done

# lines_for FOLDER CRATE...: the dependencies as FOLDER's manifest names them. Their paths are relative if the clone lies in the project.
lines_for() {
    local folder=$1 up= home crate
    case $clone in
    "$project"/*)
        while [ "${clone#"${folder%/}"/}" = "$clone" ]; do folder=$(dirname "$folder") up=../$up; done
        home="$up${clone#"${folder%/}"/}"
        ;;
    *) home=$clone ;;
    esac
    shift
    for crate in "$@"; do echo "    $crate-pbig = { path = \"$home/rapier-0.36/$crate-pbig\" }"; done
}

# has_table NAME MANIFEST
has_table() { grep -qE "^[[:space:]]*\[$1[].]" "$2"; }

patch_lines="    [patch.crates-io]$(for crate in $crates; do printf '\n    %s = { path = "patched/%s-%s" }' "$crate" "$crate" "$version"; done)"
if has_table workspace "$project/Cargo.toml"; then
    excluded='"patched"'
    case $clone in "$project"/*) excluded="\"${clone#"$project"/}\", $excluded" ;; esac
    cat <<TEXT
Add to $project/Cargo.toml, the root of the workspace, unless it has them:

    [workspace]
    exclude = [$excluded]

$patch_lines
TEXT
    users="$(users)"
    while read -r manifest; do
        [ -n "$manifest" ] || continue
        printf '\nAdd to %s:\n\n    [dependencies]\n' "$manifest"
        lines_for "${manifest%/Cargo.toml}" $(crates_of "$manifest")
    done <<<"$users"
    if [ -z "$users" ]; then
        printf '\nAdd to the Cargo.toml of each member that uses rapier:\n\n    [dependencies]\n'
        lines_for "$project" $crates
        echo "    # A path that begins with no / is relative to the root: put ../ before it for each folder between."
    fi
else
    cat <<TEXT
Add to $project/Cargo.toml, unless it has them:

    [dependencies]
$(lines_for "$project" $crates)

$patch_lines
TEXT
fi
echo
echo "Leave patched/ out of version control: this script makes it again."
