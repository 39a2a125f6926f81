#!/usr/bin/env bash
# Share of the lines of include/apso, without opencv/, that the unit tests run. Prints it for each header, the lines that no test
# runs, and the share of all; exit 1 if that is below 95 %.
# usage: scripts/coverage.sh [LEAST_PER_CENT [BUILD_FOLDER]]      needs gcovr and g++; takes some minutes
set -euo pipefail
cd "$(dirname "$0")/.."
least=${1:-95}
build=${2:-build-coverage}
modules=(math traits quality observation refinement evaluation io pipeline tracker testing sophus)

cmake -S . -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=None -DCMAKE_CXX_FLAGS="-O1 --coverage" -DAPSO_BUILD_EXAMPLES=OFF \
      -DAPSO_BUILD_BENCHMARKS=OFF >"$build.log" || { cat "$build.log"; exit 1; }
rm "$build.log"
cmake --build "$build" --parallel 2 --target "${modules[@]/#/apso_test_}"
find "$build" -name '*.gcda' -delete
ctest --test-dir "$build" --output-on-failure -R "^($(IFS='|'; echo "${modules[*]}"))\$"
# lines of templates count once, whatever they are instantiated with; what only ends a program is no line to reach
gcovr --root . --object-directory "$build" --filter 'include/apso/' --exclude 'include/apso/opencv/' --exclude-throw-branches \
      --gcov-ignore-parse-errors --sort-percentage --print-summary --txt - --fail-under-line "$least" "$build"
