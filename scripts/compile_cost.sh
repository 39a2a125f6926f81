#!/usr/bin/env bash
# What compiling costs, at -O2: CPU seconds, the smallest of some runs. Two tables:
#   use      whole programs: apso/apso.hpp alone, one that aligns a pair, the same with rendering the pair, the whole pipeline; also as
#            multiples of the cost of Eigen/Core and Eigen/Geometry, which depend less on the machine
#   headers  each header alone in an empty file, and its cost beyond that of Eigen/Core and Eigen/Geometry, which every
#            user of Eigen pays
# usage: scripts/compile_cost.sh [--compiler g++] [--runs 3] [--limits UMBRELLA,PAIR,PIPELINE] [--write]
#                                [use | headers | HEADER...]
#   without a table or header: both tables. With --limits the exit code says whether the rows of "use" stay below these seconds.
#   --write: also put the tables into docs/compile_cost.md
set -euo pipefail
cd "$(dirname "$0")/.."
usage() { echo "usage: $0 [--compiler g++] [--runs 3] [--limits UMBRELLA,PAIR,PIPELINE] [--write] [use | headers | HEADER...]" >&2; exit 2; }
compiler=g++ runs=3 limits= headers=() use= write=
while [ $# -gt 0 ]; do
  case $1 in
    --compiler|--runs|--limits) [ $# -ge 2 ] || usage; printf -v "${1#--}" %s "$2"; shift 2 ;;
    --write) write=1; shift ;;
    use) use=1; shift ;;
    headers) headers=(all); shift ;;
    apso/*.hpp) headers+=("$1"); shift ;;
    *) usage ;;
  esac
done
if [ -n "$limits" ]; then
  [[ $limits =~ ^[0-9.]+,[0-9.]+,[0-9.]+$ ]] || usage
  use=1
elif [ -z "$use" ] && [ ${#headers[@]} -eq 0 ]; then
  use=1 headers=(all)
fi
if [ "${headers[*]}" = all ]; then
  complete=1
  mapfile -t headers < <(cd include && find apso -name '*.hpp' ! -name '*_impl.hpp' ! -path 'apso/sophus/*' | LC_ALL=C sort)
fi
eigen=$(pkg-config --cflags eigen3 2>/dev/null || echo -I/usr/include/eigen3)
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
cost() {  # SOURCE -> CPU seconds
  local i best=1000000 spent flags=$eigen
  ! grep -Eq '<(apso/opencv/|opencv2/)' "$1" || flags="$eigen $(pkg-config --cflags opencv4)"
  for ((i = 0; i < runs; ++i)); do
    TIMEFORMAT='%U %S'
    # shellcheck disable=SC2086
    spent=$( { time "$compiler" -std=c++17 -O2 -Iinclude $flags -c "$1" -o "$scratch/one.o" 2> "$scratch/errors" || touch "$scratch/failed"; } 2>&1 )
    [ ! -e "$scratch/failed" ] || { cat "$scratch/errors" >&2; exit 1; }
    best=$(awk -v s="$spent" -v b="$best" 'BEGIN { split(s, t, " "); s = t[1] + t[2]; print s < b ? s : b }')
  done
  echo "$best"
}
of_headers() {  # INCLUDE... -> CPU seconds
  printf '#include <%s>\n' "$@" > "$scratch/one.cpp"
  cost "$scratch/one.cpp"
}
if [ -n "$write" ]; then  # to the terminal as well
  [ ${#headers[@]} -eq 0 ] || [ -n "${complete:-}" ] || { echo "$0: --write needs the whole table of headers" >&2; exit 2; }
  exec > >(tee "$scratch/tables")
fi
over=0
row() {  # TITLE SECONDS LIMIT
  printf '| %s | %.2f | %.1f |\n' "$1" "$2" "$(awk -v t="$2" -v b="$base" 'BEGIN { print t / b }')"
  if [ -n "$3" ] && awk -v t="$2" -v l="$3" 'BEGIN { exit !(t > l + 0) }'; then
    echo "$1: $2 s, the limit is $3 s" >&2
    over=1
  fi
}
base=$(of_headers Eigen/Core Eigen/Geometry)
if [ -n "$use" ]; then
  IFS=, read -r umbrella pair pipeline <<< "$limits"
  printf '| what is compiled | seconds | times Eigen |\n|---|---|---|\n'
  row 'Eigen/Core and Eigen/Geometry' "$base" ''
  t=$(of_headers apso/apso.hpp); row 'an empty program that includes apso/apso.hpp' "$t" "$umbrella"
  cat > "$scratch/pair.cpp" <<'END'
#include <apso/align.hpp>
double aligned(const float* intensity, const float* depth, const apso::Pinhole& camera) {
  const apso::ImageView<const float> i(intensity, camera.width, camera.height), d(depth, camera.width, camera.height);
  return apso::align(apso::frame(0.0, i, d, camera), apso::frame(0.1, i, d, camera)).confidence;
}
END
  t=$(cost "$scratch/pair.cpp"); row 'a function that aligns a pair of images' "$t" "$pair"
  t=$(cost examples/first_pair.cpp); row 'examples/first_pair.cpp: renders a pair and aligns it' "$t" ''
  t=$(cost examples/minimal_tracker.cpp); row 'examples/minimal_tracker.cpp: the whole pipeline' "$t" "$pipeline"
  [ ${#headers[@]} -eq 0 ] || echo
fi
if [ ${#headers[@]} -gt 0 ]; then
  printf '| header | seconds | beyond Eigen |\n|---|---|---|\n'
  printf '| Eigen/Core and Eigen/Geometry | %.2f | |\n' "$base"
  for h in "${headers[@]}"; do
    t=$(of_headers "$h")
    printf '| %s | %.2f | %.2f |\n' "$h" "$t" "$(awk -v t="$t" -v b="$base" 'BEGIN { print (t > b) ? t - b : 0 }')"
  done
fi
if [ -n "$write" ]; then
  sleep 1  # tee
  awk -v tables="$scratch/tables" '
    BEGIN { while ((getline line < tables) > 0) { if (line !~ /^\|/) head = ""; else { if (head == "") head = line; new[head] = new[head] line "\n" } } }
    /^\|/ && !inside { inside = 1; if ($0 in new) { printf "%s", new[$0]; skip = 1 } }
    !/^\|/ { inside = 0; skip = 0 }
    !skip { print }' docs/compile_cost.md > "$scratch/page"
  cat "$scratch/page" > docs/compile_cost.md
fi
exit $over
