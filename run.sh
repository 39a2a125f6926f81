#!/usr/bin/env bash
# From nothing to a result: installs what is needed, builds the programs, runs the tracker on a
# synthetic recording of a room with walking people, in which two of every twenty frames are blurred, and says where to look.
# Takes no arguments.
set -euo pipefail
cd "$(dirname "$0")"
./install_dependencies.sh
cmake -S . -B build -G Ninja -DCMAKE_BUILD_TYPE=Release >/dev/null
cmake --build build --target apso_programs
build/bin/apso_track synthetic:walking_xyz --spoil blur41 --output out/walking_xyz
printf '\nLook at:\n'
find out/walking_xyz -maxdepth 1 -type f | LC_ALL=C sort | sed 's/^/  /'
