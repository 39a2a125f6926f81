#!/usr/bin/env bash
# Compiles the core headers, copied to a place where no other library is in reach, with every warning an error.
# usage: syntax.sh COMPILER STANDARD alone|together INCLUDE_DIR SCRATCH_DIR EIGEN_DIR
set -euo pipefail
compiler=$1 standard=$2 mode=$3 include=$4 scratch=$5 eigen=$6
rm -rf "$scratch"
mkdir -p "$scratch/include"
cp -r "$include/apso" "$scratch/include/"
rm -rf "$scratch/include/apso/"{opencv,sophus}
grep -lrE 'yaml-cpp/|apso/io/parameters.hpp' "$scratch/include/apso/io" | xargs -r rm  # settings files need yaml-cpp
mkdir "$scratch/eigen" && ln -s "$eigen/Eigen" "$scratch/eigen/Eigen"
cd "$scratch"

flags=(-std=c++"$standard" -fsyntax-only -Wall -Wextra -Wconversion -Wshadow -pedantic -Werror
       -Iinclude -isystem eigen -x c++)
mapfile -t headers < <(cd include && find apso -name '*.hpp' | LC_ALL=C sort)
echo "${#headers[@]} headers"
if [ "$mode" = alone ]; then
  # Included twice each: a header must stand its own repetition.
  printf '%s\0' "${headers[@]}" |
    xargs -0 -P 2 -I{} "$compiler" "${flags[@]}" -include {} -include {} /dev/null
else
  for round in 1 2; do printf '#include <%s>\n' "${headers[@]}"; done >all.cpp
  "$compiler" "${flags[@]}" all.cpp
  [ "$standard" = 17 ] || exit 0
  # Reading and writing files reports errors by exceptions; everything else must do without.
  grep -v 'apso/io/' all.cpp >core.cpp
  "$compiler" "${flags[@]}" -fno-exceptions core.cpp
fi
