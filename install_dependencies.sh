#!/usr/bin/env bash
# Installs what apso's programs and tests need on Debian or Ubuntu. docs/dependencies.md says why each is there.
# --with-browser: also Chromium with Selenium (some 400 MB), for the test that opens a report in it.
# --with-analysis: also gcovr, clang-tidy and cppcheck, for scripts/coverage.sh and scripts/lint.sh.
set -euo pipefail
packages=(g++ cmake ninja-build libeigen3-dev libopencv-dev libcli11-dev nlohmann-json3-dev libyaml-cpp-dev gnuplot-nox
          libbenchmark-dev doctest-dev clang clang-format git pkgconf help2man python3 meson doxygen mkdocs-material
          python3-pybind11 python3-numpy python3-dev python3-pip python3-setuptools python3-wheel xvfb xdotool)
case "${1:-}" in
  '') ;;
  --with-browser) packages+=(chromium chromium-driver python3-selenium) ;;
  --with-analysis) packages+=(gcovr clang-tidy cppcheck) ;;
  *) echo "usage: $0 [--with-browser|--with-analysis]" >&2; exit 2 ;;
esac
missing=()
for package in "${packages[@]}"; do
  dpkg-query -W -f='${Status}' "$package" 2>/dev/null | grep -q 'install ok installed' || missing+=("$package")
done
if [ ${#missing[@]} -gt 0 ]; then
  sudo=; [ "$(id -u)" -eq 0 ] || sudo=sudo
  $sudo apt-get update -qq
  $sudo env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
fi
