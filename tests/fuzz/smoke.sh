#!/usr/bin/env bash
# Compiles the fuzz targets of text and runs each for a few thousand inputs. Exits with 77 where Clang has no libFuzzer.
# usage: smoke.sh COMPILER SOURCE_DIR SCRATCH_DIR EIGEN_DIR
set -euo pipefail
compiler=$1 source=$2 scratch=$3 eigen=$4
mkdir -p "$scratch"
flags=(-std=c++17 -O0 -fsanitize=fuzzer,address,undefined,float-cast-overflow -fno-sanitize-recover=all)
printf '#include <cstddef>\nextern "C" int LLVMFuzzerTestOneInput(const unsigned char*, std::size_t) { return 0; }\n' > "$scratch/empty.cpp"
"$compiler" "${flags[@]}" "$scratch/empty.cpp" -o "$scratch/empty" || exit 77
for target in tum_text trajectory detection_text policy_expression camera_yaml; do
  libraries=()
  [ "$target" = camera_yaml ] && libraries=(-lyaml-cpp)
  "$compiler" "${flags[@]}" -I"$source/include" -isystem "$eigen" "$source/fuzz/$target.cpp" -o "$scratch/$target" "${libraries[@]}"
  rm -rf "$scratch/corpus" && mkdir "$scratch/corpus"  # written to; the seeds are not
  "$scratch/$target" -runs=3000 -max_len=512 -timeout=20 -artifact_prefix="$scratch/$target-" "$scratch/corpus" "$source/fuzz/seeds/$target" 2> "$scratch/$target.log" ||
    { cat "$scratch/$target.log"; exit 1; }
  tail -n 1 "$scratch/$target.log"
done
