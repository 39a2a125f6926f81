#!/usr/bin/env bash
# Every C++ file that the documentation shows a part of, compiled with warnings as errors.
# usage: snippets_compile.sh COMPILER STANDARD SOURCE_DIR SYSTEM_INCLUDE...
set -euo pipefail
compiler=$1
standard=$2
source=$3
shift 3
cd "$source"
system=()
for folder in "$@"; do system+=(-isystem "$folder"); done
own=(-Iinclude -Iexamples/integrate/ros_common -Iexamples/integrate/orb_slam3 -Itests/integrate/orb_slam3
     -Itests/sophus/stand_in -Itests/integrate/ros2/stand_in)
flags=("-std=c++$standard" -Wall -Wextra -Wpedantic -Wconversion -Wshadow -Werror "${own[@]}" "${system[@]}")
# What most of them include is compiled once, in advance, which saves a quarter of the time. That each includes what it needs is seen in the
# build, where all of them are compiled without this.
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
suffix=gch
[[ $compiler != *clang* ]] || suffix=pch
printf '#include <%s>\n' Eigen/Geometry apso/apso.hpp opencv2/features2d.hpp opencv2/imgproc.hpp >"$scratch/common.hpp"
"$compiler" "${flags[@]}" -x c++-header "$scratch/common.hpp" -o "$scratch/common.hpp.$suffix"
count=0
bad=0
while IFS= read -r file; do
  count=$((count + 1))
  # included from a file of no name: a header compiled by itself would warn about its #pragma once
  echo "#include \"$source/$file\"" |
    "$compiler" "${flags[@]}" -fsyntax-only -x c++ -include "$scratch/common.hpp" - ||
    { echo "$file does not compile silently" >&2; bad=1; }
done < <(grep -rhoE '^<!-- snippet: [^ ]+\.(cpp|hpp|cc|h)' docs README.md CONTRIBUTING.md | sed 's/.*: //' | LC_ALL=C sort -u)
[ "$count" -gt 0 ] || { echo "no snippet found"; exit 1; }
echo "$count files of the documentation compiled"
exit $bad
