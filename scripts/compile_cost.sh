#!/usr/bin/env bash
# How long each header takes to compile, alone in an empty file, at -O2: CPU seconds, the smallest of some runs. Two columns: what
# the compiler needs to read the header, and what it needs beside that of Eigen/Core and Eigen/Geometry, which every user of Eigen pays.
# usage: scripts/compile_cost.sh [--compiler g++] [--runs 3] [--limit SECONDS] [HEADER...]
#   without headers: all of them. With --limit the exit code says whether apso/apso.hpp stays below it.
set -euo pipefail
cd "$(dirname "$0")/.."
compiler=g++ runs=3 limit= headers=()
while [ $# -gt 0 ]; do
  case $1 in
    --compiler) compiler=$2; shift 2 ;;
    --runs) runs=$2; shift 2 ;;
    --limit) limit=$2; shift 2 ;;
    -*) echo "usage: $0 [--compiler g++] [--runs 3] [--limit SECONDS] [HEADER...]" >&2; exit 2 ;;
    *) headers+=("$1"); shift ;;
  esac
done
if [ ${#headers[@]} -eq 0 ]; then
  mapfile -t headers < <(cd include && find apso -name '*.hpp' ! -name '*_impl.hpp' ! -path 'apso/sophus/*' | LC_ALL=C sort)
fi
eigen=$(pkg-config --cflags eigen3 2>/dev/null || echo -I/usr/include/eigen3)
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
cost() {  # INCLUDE... -> CPU seconds
  local i best=1000000 spent flags=$eigen
  : > "$scratch/one.cpp"
  for i in "$@"; do echo "#include <$i>" >> "$scratch/one.cpp"; [[ $i == apso/opencv/* ]] && flags="$eigen $(pkg-config --cflags opencv4)"; done
  for ((i = 0; i < runs; ++i)); do
    TIMEFORMAT='%U %S'
    # shellcheck disable=SC2086
    spent=$( { time "$compiler" -std=c++17 -O2 -Iinclude $flags -c "$scratch/one.cpp" -o "$scratch/one.o" 2> "$scratch/errors" || touch "$scratch/failed"; } 2>&1 )
    [ ! -e "$scratch/failed" ] || { cat "$scratch/errors" >&2; exit 1; }
    best=$(awk -v s="$spent" -v b="$best" 'BEGIN { split(s, t, " "); s = t[1] + t[2]; print s < b ? s : b }')
  done
  echo "$best"
}
base=$(cost Eigen/Core Eigen/Geometry)
printf '| header | seconds | beside Eigen |\n|---|---|---|\n'
printf '| Eigen/Core and Eigen/Geometry | %.2f | |\n' "$base"
for h in "${headers[@]}"; do
  t=$(cost "$h")
  printf '| %s | %.2f | %.2f |\n' "$h" "$t" "$(awk -v t="$t" -v b="$base" 'BEGIN { print (t > b) ? t - b : 0 }')"
  if [ "$h" = apso/apso.hpp ] && [ -n "$limit" ]; then
    awk -v t="$t" -v l="$limit" 'BEGIN { exit !(t > l + 0) }' && { echo "apso/apso.hpp takes $t s, the limit is $limit s" >&2; over=1; }
  fi
done
exit ${over:-0}
