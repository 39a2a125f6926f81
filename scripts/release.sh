#!/usr/bin/env bash
# Makes a release of the commit that is checked out: a tag, and the folder dist/ with the archive of the sources, the
# single header, a Meson wrap and checksums. Before that: ./test.sh, scripts/results.sh DATA for docs/results.md, benchmarks/compare_peers.sh
# and benchmarks/verdict with the seeds of the new version for docs/benchmarks.md, set the version in include/apso/version.hpp (and where
# scripts/check_version.sh says), and turn the "Unreleased" section of CHANGELOG.md into "## VERSION - DATE".
# usage: scripts/release.sh VERSION [--no-tag]
set -euo pipefail
stop() { echo "release.sh: $*" >&2; exit 1; }
[ $# -ge 1 ] && [ $# -le 2 ] || { echo "usage: scripts/release.sh VERSION [--no-tag]" >&2; exit 2; }
[ $# -eq 1 ] || [ "$2" = --no-tag ] || { echo "usage: scripts/release.sh VERSION [--no-tag]" >&2; exit 2; }
cd "$(dirname "$0")/.."
found=$(scripts/check_version.sh)
[ "$found" = "$1" ] || stop "asked for version $1, but include/apso/version.hpp says $found"
[ -z "$(git status --porcelain)" ] || stop "there are changes that are not committed"
grep -Eq "^## $1 - [0-9]{4}-[0-9]{2}-[0-9]{2}$" CHANGELOG.md || stop "CHANGELOG.md has no section '## $1 - YYYY-MM-DD'"
! git rev-parse -q --verify "refs/tags/v$1" >/dev/null || stop "the tag v$1 exists already"

rm -rf dist
mkdir dist
name=apso-$1
git archive --format=tar --prefix="$name/" HEAD | gzip -n > "dist/$name.tar.gz"  # -n: the same bytes every time
scripts/amalgamate.sh dist/apso_single.hpp
sum=$(sha256sum "dist/$name.tar.gz" | cut -d' ' -f1)
sed "s/@VERSION@/$1/g; s/@SHA256@/$sum/" packaging/meson/apso.wrap.in > dist/apso.wrap
(cd dist && sha256sum ./* > ../SHA256SUMS && mv ../SHA256SUMS .)
if [ $# -eq 1 ]; then
  git tag -a "v$1" -m "apso $1"
  echo "Tagged v$1. To publish: git push --follow-tags, and the files of dist/."
fi
ls -l dist
