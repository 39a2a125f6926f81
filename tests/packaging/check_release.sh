#!/usr/bin/env bash
# Tests the release script in a temporary repository: it refuses what is not ready, and releases what is.
# usage: check_release.sh SOURCE SCRATCH COMPILER EIGEN
set -euo pipefail
source=$1 scratch=$2 compiler=$3 eigen=$4
rm -rf "$scratch"; mkdir -p "$scratch/repository"
cd "$source"
cp -r include cmake packaging scripts CMakeLists.txt LICENSE CHANGELOG.md CITATION.cff "$scratch/repository"
mkdir -p "$scratch/repository/examples/integrate"; cp -r examples/integrate/{build,ros1,ros2} "$scratch/repository/examples/integrate"
cd "$scratch/repository"
export GIT_CONFIG_GLOBAL=/dev/null GIT_AUTHOR_NAME=tester GIT_AUTHOR_EMAIL=tester@example.org
export GIT_COMMITTER_NAME=tester GIT_COMMITTER_EMAIL=tester@example.org
git init -q .; printf '/dist/\n' > .gitignore
refused() {  # WORDS COMMAND...
  local words=$1; shift
  if "$@" > "$scratch/log" 2>&1 || ! grep -qF -- "$words" "$scratch/log"; then
    echo "'$*' should be refused with '$words', but:"; cat "$scratch/log"; exit 1
  fi
}
commit() { git add -A; git commit -qm "$1"; }
commit start
refused "asked for version 7.8.9" scripts/release.sh 7.8.9
sed -i 's/^#define APSO_VERSION_MAJOR .*/#define APSO_VERSION_MAJOR 7/; s/^#define APSO_VERSION_MINOR .*/#define APSO_VERSION_MINOR 8/
        s/^#define APSO_VERSION_PATCH .*/#define APSO_VERSION_PATCH 9/; s/^#define APSO_VERSION ".*/#define APSO_VERSION "7.8.9"/' include/apso/version.hpp
refused "CITATION.cff says version" scripts/release.sh 7.8.9
sed -i 's/^version: .*/version: 7.8.9/' CITATION.cff
sed -i 's/^  "version": .*/  "version": "7.8.9",/' packaging/vcpkg/vcpkg.json
sed -i 's/apso-[0-9.]*\.tar/apso-7.8.9.tar/' examples/integrate/build/fetch_content/CMakeLists.txt
sed -i 's/<version>.*</<version>7.8.9</' examples/integrate/ros1/package.xml examples/integrate/ros2/package.xml
refused "not committed" scripts/release.sh 7.8.9
commit "version 7.8.9"
refused "no section '## 7.8.9" scripts/release.sh 7.8.9
sed -i 's/^## Unreleased$/&\n\n## 7.8.9 - 2026-01-31/' CHANGELOG.md
commit changelog
scripts/release.sh 7.8.9 >/dev/null
[ "$(git describe)" = v7.8.9 ]
refused "the tag v7.8.9 exists" scripts/release.sh 7.8.9
# what it made can be used
cd dist; sha256sum --quiet -c SHA256SUMS
tar xf apso-7.8.9.tar.gz
printf '#include <apso/math/se3.hpp>\nint main() { return apso::rotation_angle(apso::Pose::Identity()) == 0 ? 0 : 1; }\n' > use.cpp
"$compiler" -std=c++17 -Iapso-7.8.9/include -I"$eigen" use.cpp -o use
./use
grep -q "apso 7.8.9 in one file" apso_single.hpp
grep -q "source_hash = $(sha256sum apso-7.8.9.tar.gz | cut -d' ' -f1)" apso.wrap
echo "the release script works"
