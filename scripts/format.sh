#!/usr/bin/env bash
# Formats all C++ of the project as .clang-format says, or checks that it is (exit 1 and the lines otherwise).
# usage: scripts/format.sh [--check] [CLANG_FORMAT]      needs clang-format 14 (Debian: clang-format)
set -euo pipefail
cd "$(dirname "$0")/.."
action=(-i)
if [ "${1:-}" = --check ]; then
  action=(--dry-run -Werror)
  shift
fi
find include tests benchmarks examples fuzz python -name build -prune -o \( -name '*.hpp' -o -name '*.cpp' \) -print0 |
  xargs -0 -n 40 -P "$(nproc)" "${1:-clang-format}" "${action[@]}"
