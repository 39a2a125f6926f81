#!/usr/bin/env bash
# The version is written in version.hpp; the files of other tools that must repeat it agree, or this says which does not.
# Prints the version.
set -euo pipefail
cd "$(dirname "$0")/.."
header=include/apso/version.hpp
number() { sed -n "s/^#define APSO_VERSION_$1 \([0-9]*\)$/\1/p" $header; }
version=$(sed -n 's/^#define APSO_VERSION "\(.*\)"/\1/p' $header)
bad=0
agree() {  # FILE FOUND
  [ "$2" = "$version" ] || { echo "$1 says version '$2', $header says '$version'" >&2; bad=1; }
}
agree "$header (APSO_VERSION_MAJOR, _MINOR, _PATCH)" "$(number MAJOR).$(number MINOR).$(number PATCH)"
agree CITATION.cff "$(sed -n 's/^version: //p' CITATION.cff)"
agree packaging/vcpkg/vcpkg.json "$(sed -n 's/^  "version": "\(.*\)",/\1/p' packaging/vcpkg/vcpkg.json)"
archive=examples/integrate/build/fetch_content/CMakeLists.txt
agree $archive "$(sed -n 's/.*apso-\([0-9.]*\)\.tar\.gz.*/\1/p' $archive)"
for package in examples/integrate/ros1/package.xml examples/integrate/ros2/package.xml; do
  agree $package "$(sed -n 's/^ *<version>\(.*\)<\/version>/\1/p' $package)"
done
grep -q '^## Unreleased$' CHANGELOG.md || { echo "CHANGELOG.md has no section '## Unreleased'" >&2; bad=1; }
[ $bad -eq 0 ] || exit 1
echo "$version"
