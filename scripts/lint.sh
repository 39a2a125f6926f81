#!/usr/bin/env bash
# Static analysis of all headers: clang-tidy with the checks of .clang-tidy, and cppcheck on those without OpenCV. Prints what
# they find; exit 1 if that is anything.
# usage: scripts/lint.sh [clang-tidy|cppcheck]      needs clang-tidy, cppcheck, pkg-config (Debian has them under these names)
set -uo pipefail
cd "$(dirname "$0")/.."
case "${1:-all}" in all | clang-tidy | cppcheck) ;; *) echo "usage: $0 [clang-tidy|cppcheck]" >&2; exit 2 ;; esac
scratch=$(mktemp -d)
trap 'rm -r "$scratch"' EXIT

(cd include && find apso -name '*.hpp' ! -name '*_impl.hpp' | LC_ALL=C sort | sed 's/.*/#include <&>/') >"$scratch/all.cpp"
grep -v 'apso/\(opencv\|sophus\)/' "$scratch/all.cpp" >"$scratch/core.cpp"
found=0
if [ "${1:-all}" != cppcheck ]; then
  read -r -a system <<<"$(pkg-config --cflags eigen3 opencv4 yaml-cpp | sed 's/-I/-isystem /g')"
  echo "clang-tidy: all headers"
  clang-tidy --quiet --config-file=.clang-tidy --warnings-as-errors='*' "$scratch/all.cpp" -- -std=c++17 -I include "${system[@]}" \
             -isystem tests/sophus/stand_in 2>"$scratch/log" || { cat "$scratch/log"; found=1; }
fi
if [ "${1:-all}" != clang-tidy ]; then
  echo "cppcheck: headers without OpenCV"
  # sizes of types that it does not see are no fault of ours
  cppcheck --language=c++ --std=c++17 --enable=warning,performance,portability --inline-suppr --quiet --error-exitcode=1 \
           --suppress=missingIncludeSystem -I include "$scratch/core.cpp" || found=1
fi
exit "$found"
