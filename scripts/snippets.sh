#!/usr/bin/env bash
# Code in the documentation is never typed there. A block is written as
#
#     <!-- snippet: examples/align_pair.cpp align -->
#     ```cpp
#     ```
#
# and this script fills it with the lines between "[align]" and "[/align]" of that file, or with the whole file when no name
# is given. usage: scripts/snippets.sh --write    fill all blocks
#                  scripts/snippets.sh --check    fail where a block differs from its file, or code has no file
set -euo pipefail
case "${1:-}" in --write|--check) ;; *) echo "usage: scripts/snippets.sh --write|--check" >&2; exit 2 ;; esac
cd "$(dirname "$0")/.."
bad=0
count=0
scratch=$(mktemp)
trap 'rm -f "$scratch"' EXIT
while IFS= read -r page; do
  # Prints the page as it should be. Exit code 1: a file or a section is missing, or code stands without a file.
  if ! awk -v page="$page" '
    function complain(text) { print page ":" FNR ": " text > "/dev/stderr"; failed = 1 }
    function insert(file, name,    line, inside, n, lines, indent, i, smallest) {
      inside = name == ""
      n = 0
      while ((status = (getline line < file)) > 0) {
        if (name != "" && index(line, "[" name "]")) { inside = 1; continue }
        if (name != "" && index(line, "[/" name "]")) { inside = 0; continue }
        if (line ~ /^[ \t]*(\/\/|#) \[\/?[a-z_0-9]+\]$/) continue
        if (inside) lines[n++] = line
      }
      if (status < 0) complain("there is no file " file)
      else if (n == 0) complain(file " has no section [" name "]")
      close(file)
      smallest = 1000
      for (i = 0; i < n; ++i) {
        match(lines[i], /^ */)
        if (lines[i] != "" && RLENGTH < smallest) smallest = RLENGTH
      }
      for (i = 0; i < n; ++i) print substr(lines[i], smallest + 1)
    }
    /^<!-- snippet: / { file = $3; name = $4 == "-->" ? "" : $4; print; next }
    /^```/ && !in_block {
      in_block = 1
      print
      if (file != "") insert(file, name)
      else if ($0 ~ /^```(c|cpp|c\+\+|cmake|meson|python)/) complain("code without a file: write <!-- snippet: FILE [NAME] --> before it")
      filled = file != ""
      file = ""
      next
    }
    /^```/ && in_block { in_block = 0; print; next }
    in_block && filled { next }
    { if (file != "" && $0 != "") { complain("no code block follows the snippet"); file = "" } print }
    END { exit failed }' "$page" > "$scratch"; then
    bad=1
  fi
  count=$((count + $(grep -c '^<!-- snippet: ' "$page" || true)))
  if ! cmp -s "$scratch" "$page"; then
    if [ "$1" = --write ]; then
      cat "$scratch" > "$page"
    else
      echo "$page: a code block differs from its file; scripts/snippets.sh --write brings it up to date" >&2
      diff "$page" "$scratch" >&2 || true
      bad=1
    fi
  fi
done < <(find docs README.md CONTRIBUTING.md -name '*.md' | LC_ALL=C sort)
[ $bad -eq 0 ] || exit 1
echo "$count code blocks are those of their files"
