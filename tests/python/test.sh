#!/usr/bin/env bash
# Installs the Python package into a folder of its own, and runs its tests and its example.
# usage: test.sh PYTHON SOURCE SCRATCH REFERENCE_PROGRAM [APSO_SYNTH]
set -euo pipefail
python=$1 source=$2 scratch=$3 reference=$4 synth=${5:-}
mkdir -p "$scratch/data"
rm -rf "$scratch/package"
export APSO_PYTHON_BUILD=$scratch/build PIP_DISABLE_PIP_VERSION_CHECK=1 PYTHONDONTWRITEBYTECODE=1
export CMAKE_ARGS=-DCMAKE_CXX_FLAGS_RELEASE=-O1  # as all that only tests use
"$python" -m pip install --quiet --no-build-isolation --no-index --no-deps --target "$scratch/package" "$source"
for file in py.typed __init__.pyi; do
  [ -f "$scratch/package/apso/$file" ] || { echo "$file is not installed"; exit 1; }
done
"$reference" "$scratch/data"
export PYTHONPATH=$scratch/package APSO_REFERENCE=$scratch/data
cd "$source/python/tests"
"$python" -m unittest -v test_apso
# What the stub declares is what there is.
"$python" check_stub.py "$scratch/package/apso/__init__.pyi"
if "$python" -c 'import mypy' 2>/dev/null; then
  printf 'import numpy as np\nimport apso\nz = np.zeros((48, 64), np.float32)\nT = apso.align(z, z, z, z, (50, 50, 32, 24)).T\n' > "$scratch/typed.py"
  "$python" -m mypy --strict --cache-dir "$scratch/mypy" "$scratch/typed.py"
fi
# The example of the documentation, on two frames of a recording.
if [ -n "$synth" ] && "$python" -c 'import matplotlib' 2>/dev/null; then
  rm -rf "$scratch/room"
  "$synth" walking_xyz --output "$scratch/room" --frames 12 >/dev/null
  rgb=("$scratch"/room/rgb/*.png)
  depth=("$scratch"/room/depth/*.png)
  "$python" "$source/python/examples/align_pair.py" "${rgb[0]}" "${depth[0]}" "${rgb[11]}" "${depth[11]}" 535.4 539.2 320.1 247.6 "$scratch/pair.png" |
    tee "$scratch/pair.txt"
  grep -q '^Converged, confidence 0.9' "$scratch/pair.txt"
  [ "$(head -c 4 "$scratch/pair.png" | tail -c 3)" = PNG ] || { echo "the example drew no picture"; exit 1; }
fi
