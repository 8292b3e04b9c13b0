#!/usr/bin/env bash
# Checks the documents: links and anchors, lengths, and the commands that they show. A test compares their numbers.
#   scripts/docs.sh [--no-run]     --no-run leaves out the commands
# Blocks marked `sh` run from the repository's root, each for at most DOCS_SECONDS seconds (300). Other blocks are not run.
# It needs bash, awk, sed and grep, and for the commands cargo.
set -uo pipefail
cd "$(dirname "$0")/.."

runs=true
case ${1:-} in
'') ;;
--no-run) runs=false ;;
*) sed -n '2,5s/^# \{0,1\}//p' "$0" && exit $([ "$1" = --help ] && echo 0 || echo 2) ;;
esac
seconds=${DOCS_SECONDS:-300}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
faults=0
# The documents whose words are counted. READMEs of crates and of the page are short, and checked for links only.
documents=$(ls README.md CHANGELOG.md CONTRIBUTING.md SECURITY.md && find docs -name '*.md' | sort)
crates=$(ls shaders/README.md crates/*/README.md page/README.md avian/README.md 2>/dev/null)

fault() {
    echo "docs: $*" >&2
    faults=$((faults + 1))
}

# prose FILE: the text without code blocks and inline code.
prose() {
    awk '/^ *```/ { code = !code; next } !code { gsub(/`[^`]*`/, ""); print }' "$1"
}

# links FILE: the targets of its links and pictures, but for those on the web.
links() {
    prose "$1" | grep -o '](\([^)]*\))' | sed 's/^](//; s/)$//' | grep -v '^[a-z]*://' | grep -v '^mailto:'
}

# anchors FILE: the anchors of its headings, as GitHub makes them.
anchors() {
    awk '/^ *```/ { code = !code; next } !code && /^#+ / { sub(/^#+ /, ""); print tolower($0) }' "$1" |
        sed 's/[^a-z0-9 _-]//g; s/ /-/g'
}

check_links() {
    local file target path anchor
    for file in $documents $crates; do
        links "$file" >"$work/links"
        while IFS= read -r target; do
            path=${target%%#*}
            anchor=
            case $target in *'#'*) anchor=${target#*#} ;; esac
            if [ -z "$path" ]; then path=$file; else path=$(dirname "$file")/$path; fi
            if [ ! -e "$path" ]; then
                fault "$file: there is no '$target'"
            elif [ -n "$anchor" ] && ! anchors "$path" | grep -qxF -- "$anchor"; then
                fault "$file: '$target' has no such heading"
            fi
        done <"$work/links"
    done
}

# words FILE...: the words, without the bars of tables and without comments, which no reader sees.
words() {
    cat "$@" | awk '/^<!--/ { hidden = 1 } hidden { if (/-->$/) hidden = 0; next } { for (i = 1; i <= NF; i++) if ($i ~ /[A-Za-z0-9]/) n++ } END { print n + 0 }'
}

# at_most LIMIT COUNT WHAT
at_most() {
    if [ "$2" -gt "$1" ]; then fault "$3: $2, more than $1"; else echo "$3: $2 of $1"; fi
}

check_lengths() {
    at_most 600 "$(words README.md)" "words of README.md"
    at_most 2000 "$(words docs/ARCHITECTURE.md)" "words of docs/ARCHITECTURE.md"
    at_most 10000 "$(words README.md docs/*.md)" "words of README.md and docs"
    at_most 60000 "$(cat docs/benchmarks/results/*.csv | wc -c)" "bytes of measured results"
}

# within SECONDS COMMAND...: runs a command, and ends it with its children after this time. (macOS has no `timeout`.)
within() {
    local limit=$1 waited=0 pid
    shift
    set -m
    "$@" &
    pid=$!
    set +m
    while kill -0 "$pid" 2>/dev/null; do
        if [ "$waited" -ge "$limit" ]; then
            kill -- "-$pid" 2>/dev/null
            wait "$pid" 2>/dev/null
            echo "it did not end within $limit s"
            return 124
        fi
        sleep 1
        waited=$((waited + 1))
    done
    wait "$pid"
}

# blocks FILE: writes the blocks marked `sh` into files, with the folder of built programs where cargo has it.
blocks() {
    rm -f "$work"/block.*
    awk -v name="$work/block" '
        /^```sh$/ { inside = 1; out = name "." ++n; next }
        /^```/ { inside = 0 }
        inside { print >out }' "$1"
}

run_blocks() {
    local file block built=${CARGO_TARGET_DIR:-target}
    for file in $documents; do
        blocks "$file"
        for block in "$work"/block.*; do
            [ -f "$block" ] || continue
            echo "== $file: $(head -n 1 "$block") ..."
            sed "s|^target/release/|$built/release/|" "$block" >"$work/script"
            within "$seconds" bash -euo pipefail "$work/script" >"$work/log" 2>&1 </dev/null && continue
            cat "$block" "$work/log" >&2
            fault "$file: a block of commands failed"
        done
    done
}

check_links
check_lengths
if $runs; then
    if cargo build --release --examples --bins; then run_blocks; else fault "the build failed"; fi
fi
[ "$faults" = 0 ] || { echo "docs: $faults faults" >&2 && exit 1; }
echo "docs: no faults"
