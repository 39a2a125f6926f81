#!/usr/bin/env bash
# Writes apso_single.hpp: everything that apso/apso.hpp includes, in one file that needs Eigen only.
# usage: scripts/amalgamate.sh OUTPUT
set -euo pipefail
[ $# -eq 1 ] || { echo "usage: $0 OUTPUT, e.g. $0 apso_single.hpp" >&2; exit 2; }
include=$(cd "$(dirname "$0")/.." && pwd)/include
version=$(sed -n 's/^#define APSO_VERSION "\(.*\)"/\1/p' "$include/apso/version.hpp")
{
  echo "// apso $version in one file, made by scripts/amalgamate.sh. Do not edit it: edit the headers it was made of."
  echo "// Use this file or the folder apso/, not both in one program."
  echo "//"
  sed 's/^/\/\/ /; s/ *$//' "$(dirname "$include")/LICENSE"
  echo "#pragma once"
  echo "#ifdef APSO_VERSION"
  echo '#error "apso: include either apso_single.hpp or the headers of the folder apso/, not both"'
  echo "#endif"
  # Each header once, where it is first included; includes of other libraries once as well, unless they are conditional.
  awk -v root="$include" '
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
    BEGIN { insert("apso/apso.hpp") }'
} > "$1"
