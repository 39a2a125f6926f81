#!/usr/bin/env bash
# Builds the alignment and its peers with the same flags, scores them on the same pairs, then times them in one run.
# The last lines printed: ratios to apso at the same resolution, and ratios to the default, opencv_rgbd=... (the peer's time over
# ours). A peer that is not installed is left out:
#   OpenCV contrib  libopencv-contrib-dev (comes with libopencv-dev)     Open3D  libopen3d-dev
#   MRPT  libmrpt-vision-dev
#   compare_peers.sh                    -O3 -march=native
#   FLAGS=-O2 compare_peers.sh          plain x86-64
#   compare_peers.sh --views 4          arguments go to the program, see --help
set -euo pipefail
root=$(cd "$(dirname "$0")/.." && pwd)
flags=${FLAGS:--O3 -march=native}
build=${BUILD:-$root/build/peers$(printf '%s' "$flags" | tr -c 'a-zA-Z0-9\n' '_')}
cmake -S "$root" -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=None -DCMAKE_CXX_FLAGS="$flags -DNDEBUG" \
      -DAPSO_BUILD_EXAMPLES=OFF -DAPSO_BUILD_TESTS=OFF >/dev/null
cmake --build "$build" --target compare_peers >/dev/null
printf 'flags: %s\n' "$flags"
export OMP_NUM_THREADS=1 MALLOC_TRIM_THRESHOLD_=1000000000 MALLOC_MMAP_THRESHOLD_=1000000000
exec "$build/bin/compare_peers" "$@"
