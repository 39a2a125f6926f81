#!/usr/bin/env bash
# The whole method for 20,000 frames: memory after the warm-up against memory at the end, and the hash of all results on 1, 2 and 4
# threads at -O3, at -O2, and compiled for this machine. Exit 1 if the memory grows by 1 % or a hash differs where it must not:
# -march=native joins multiplications and additions (FMA), so its hash is told and may differ.
# usage: scripts/long_run.sh [FRAMES]      needs what the benchmarks need; takes about half a minute per 1000 frames and run
set -euo pipefail
cd "$(dirname "$0")/.."
frames=${1:-20000}
build=build-long-run
mkdir -p "$build"
read -r -a flags <<<"$(pkg-config --cflags eigen3 opencv4 | sed 's/-I/-isystem /g')"
libraries=(-lopencv_video -lopencv_features2d -lopencv_calib3d -lopencv_imgproc -lopencv_core)
compiler=${CXX:-c++}
[ -z "${CMAKE_CXX_COMPILER_LAUNCHER:-}" ] || compiler="$CMAKE_CXX_COMPILER_LAUNCHER $compiler"

failed=0
reference=
run() {  # run NAME THREADS: one line, its hash compared with the first
  local line hash same=
  line=$("$build/long_run$1" --frames "$frames" --warm-up $((frames / 10)) --threads "$2" | tee "$build/$1-$2.csv" | tail -1) || failed=1
  hash=${line##* }
  : "${reference:=$hash}"
  if [ "$hash" != "$reference" ]; then
    same=', DIFFERS'
    [ "$1" = -march=native ] || failed=1
  fi
  echo "$1: $line$same"
}
for option in -O3 -O2 -march=native; do
  $compiler -std=c++17 -O3 -DNDEBUG "$option" -I include "${flags[@]}" -c benchmarks/long_run.cpp -o "$build/long_run$option.o"
  c++ "$build/long_run$option.o" -o "$build/long_run$option" "${libraries[@]}"
  if [ "$option" = -O3 ]; then
    for threads in 1 2 4; do run "$option" "$threads"; done
  else
    run "$option" 2
  fi
done
exit "$failed"
