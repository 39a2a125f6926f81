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
  # Included twice each: a header must stand its own repetition. Eigen takes half of the time, so what of it a header
  # reaches through its includes is compiled in advance; a header that reaches none must do without.
  [[ $compiler != *clang* ]] || compiled=pch
  for part in Core Geometry; do
    echo "#include <Eigen/$part>" >"$part.hpp"
    "$compiler" -std=c++"$standard" -isystem eigen -x c++-header "$part.hpp" -o "$part.hpp.${compiled:-gch}"
  done
  declare -A reached
  reach() {  # HEADER: sets reached[HEADER] to Geometry.hpp, Core.hpp (which Geometry brings along) or /dev/null
    local inner name=$1
    [ -z "${reached[$name]:-}" ] || return 0
    reached[$name]=/dev/null
    if grep -q '^#include <Eigen/Core>' "include/$name"; then reached[$name]=Core.hpp; fi
    for inner in $(sed -n 's/^#include <\(apso\/[^>]*\)>.*/\1/p' "include/$name"); do
      [ -e "include/$inner" ] || continue
      reach "$inner"
      [ "${reached[$inner]}" = /dev/null ] || [ "${reached[$name]}" = Geometry.hpp ] || reached[$name]=${reached[$inner]}
    done
    if grep -q '^#include <Eigen/Geometry>' "include/$name"; then reached[$name]=Geometry.hpp; fi
  }
  for header in "${headers[@]}"; do
    reach "$header"
    printf -- '-include\0%s\0-include\0%s\0-include\0%s\0' "${reached[$header]}" "$header" "$header"
  done | xargs -0 -P 2 -n 6 sh -c 'exec "$@" /dev/null' compile "$compiler" "${flags[@]}"
else
  for round in 1 2; do printf '#include <%s>\n' "${headers[@]}"; done >all.cpp
  "$compiler" "${flags[@]}" all.cpp
  [ "$standard" = 17 ] || exit 0
  # Reading and writing files reports errors by exceptions; everything else must do without.
  grep -v 'apso/io/' all.cpp >core.cpp
  "$compiler" "${flags[@]}" -fno-exceptions core.cpp
fi
