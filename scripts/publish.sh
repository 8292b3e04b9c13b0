#!/usr/bin/env bash
# Checks what would be published, and publishes nothing: the packages' contents, a build of each, licences of the dependencies,
# and a build with the oldest Rust that is supported.
set -euo pipefail
cd "$(dirname "$0")/.."
. scripts/common.sh
packages="pbig-shaders pbig-core pbig-gpu pbig-adapter rapier-pbig"
options=''
for package in $packages; do
    options="$options -p $package"
    files=$(cargo package --locked --list --allow-dirty -p "$package")
    for file in README.md LICENSE-MIT LICENSE-APACHE; do
        case $'\n'$files$'\n' in *$'\n'"$file"$'\n'*) ;; *) echo "$package has no $file" && exit 1 ;; esac
    done
done
# Copies, because links break on Windows.
for folder in shaders crates/pbig-core crates/pbig-gpu crates/pbig-adapter crates/rapier-pbig; do
    cmp LICENSE-MIT "$folder/LICENSE-MIT"
    cmp LICENSE-APACHE "$folder/LICENSE-APACHE"
done
# Each is built from its package, against the others' packages.
step cargo publish --dry-run --locked --allow-dirty $options

if has cargo-deny; then
    step cargo deny --locked check licenses bans sources
    # The list of vulnerabilities comes from outside.
    if cargo deny --locked fetch db 2>/dev/null; then
        step cargo deny --locked check advisories
    else
        echo "== left out: advisories; their list cannot be fetched"
    fi
else
    left_out "cargo-deny"
fi

# Once there is a release, its interface is compared with this one's.
if tag=$(git describe --tags --abbrev=0 --match 'v*' 2>/dev/null); then
    if has cargo-semver-checks; then
        step cargo semver-checks --baseline-rev "$tag" $options
    else
        left_out "a comparison with $tag, for which cargo-semver-checks is missing"
    fi
fi

version=$(sed -n 's/^rust-version = "\(.*\)"/\1/p' Cargo.toml)
if has rustup && rustup run "$version" rustc --version >/dev/null 2>&1; then
    step env RUSTUP_TOOLCHAIN="$version" cargo check --locked --all-features $options --target-dir "$(target_folder)/msrv"
else
    left_out "a build with Rust $version"
fi
echo "== packages: all passed"
