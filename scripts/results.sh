#!/usr/bin/env bash
# Makes docs/results.md: builds the programs and runs the ablation on all recordings of a folder and on ten seeds of each synthetic
# recording. Takes the arguments of scripts/results.py (--help), first the folder; can be stopped and started again.
set -euo pipefail
root="$(cd "$(dirname "$0")/.." && pwd)"
cmake -S "$root" -B "$root/build" -G Ninja -DCMAKE_BUILD_TYPE=Release >/dev/null
cmake --build "$root/build" --target apso_track apso_ablate
exec python3 "$root/scripts/results.py" "$@"
