#!/usr/bin/env bash
# Writes the library as one file that needs Eigen only: all of apso/apso.hpp, or some of its parts.
# usage: scripts/amalgamate.sh [--only PART[,PART...]] OUTPUT
#   PART: score, threshold, motion, align, blend, evaluate, track, or a header such as apso/testing/synthetic.hpp
set -euo pipefail
include=$(cd "$(dirname "$0")/.." && pwd)/include
parts=() only=
for p in score threshold motion align blend evaluate track; do
  [ ! -e "$include/apso/$p.hpp" ] || parts+=("$p")
done
usage() {
  printf 'usage: %s [--only PART[,PART...]] OUTPUT, e.g. %s --only align apso_align.hpp\nparts: %s, or a header such as apso/testing/synthetic.hpp\n' "$0" "$0" "${parts[*]}" >&2
  exit 2
}
if [ "${1:-}" = --only ]; then
  [ $# -ge 2 ] || usage
  only=$2
  shift 2
fi
{ [ $# -eq 1 ] && [[ $1 != -* ]]; } || usage
roots=apso/apso.hpp
if [ -n "$only" ]; then
  roots=
  for p in ${only//,/ }; do
    if [[ " ${parts[*]} " == *" $p "* ]]; then
      roots+=" apso/$p.hpp"
    elif [[ $p == apso/*.hpp && -e $include/$p ]]; then
      roots+=" $p"
    else
      echo "$0: there is no part '$p'" >&2
      usage
    fi
  done
fi
version=$(sed -n 's/^#define APSO_VERSION "\(.*\)"/\1/p' "$include/apso/version.hpp")
{
  echo "// apso $version${only:+ ($only)} in one file, made by scripts/amalgamate.sh. Do not edit it: edit the headers it was made of."
  echo "// Use this file or the folder apso/, not both in one program."
  echo "//"
  sed 's/^/\/\/ /; s/ *$//' "$(dirname "$include")/LICENSE"
  echo "#pragma once"
  echo "#if defined(APSO_VERSION) || defined(APSO_SINGLE_FILE)"
  echo '#error "apso: include either one single file or the headers of the folder apso/, not both"'
  echo "#endif"
  echo "#define APSO_SINGLE_FILE"
  # Each header once, where it is first included; includes of other libraries once as well, unless they are conditional.
  awk -v root="$include" -v roots="$roots" '
    function insert(file,    line, path, depth) {
      if (file in done) return
      done[file] = 1
      print "\n// ---- " file
      depth = 0
      while ((getline line < (root "/" file)) > 0) {
        if (line ~ /^#pragma once/) continue
        if (line ~ /^#[ ]*if/) ++depth
        if (line ~ /^#[ ]*endif/) --depth
        if (match(line, /^#[ ]*include <apso\/[^>]*>/)) {
          path = line
          sub(/^#[ ]*include </, "", path)
          sub(/>.*/, "", path)
          insert(path)
        } else if (line ~ /^#[ ]*include </ && depth == 0) {
          if (!(line in seen)) print line
          seen[line] = 1
        } else {
          print line
        }
      }
      close(root "/" file)
    }
    BEGIN { n = split(roots, list, " "); for (i = 1; i <= n; ++i) insert(list[i]) }'
} > "$1"
