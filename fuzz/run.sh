#!/bin/bash
# Feeds random bytes to the readers of jobs, meshes and checkpoints, one after the other.
#
#   fuzz/run.sh [SECONDS [TARGET...]]        600 seconds each; targets: job mesh checkpoint
#
# Needs a C++ compiler for libFuzzer and nothing else: no nightly Rust, no cargo-fuzz. Starts from fuzz/corpus,
# the jobs and the meshes; what is new goes to fuzz/target/corpus, an input that crashes to fuzz/target/TARGET-crash-...; a crash is
# repeated by: target/release/TARGET FILE.
set -euo pipefail
here=$(dirname "${BASH_SOURCE[0]}")
# The folder of the solver's build, whose crates serve here, too.
built=$(realpath -m "${CARGO_TARGET_DIR:-$here/../target}")
cd "$here"
seconds=${1:-600}
targets=("${@:2}")
[[ ${#targets[@]} -gt 0 ]] || targets=(job mesh checkpoint)

RUSTC_WRAPPER="$PWD/instrument.sh" cargo build --release --locked --target-dir "$built"

export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1
for target in "${targets[@]}"; do
    more=()
    [[ $target == job ]] && more=(../tests/refusals ../jobs)
    [[ $target == mesh ]] && more=(../tests/meshes)
    mkdir -p "target/corpus/$target"
    found=0
    # Memory stays bounded: no input may make a reader take more.
    "$built/release/$target" -max_total_time="$seconds" -timeout=20 -rss_limit_mb=2048 -malloc_limit_mb=512 \
        -print_final_stats=1 -verbosity=0 -artifact_prefix="target/$target-" \
        "target/corpus/$target" "corpus/$target" "${more[@]}" 2>&1 |
        grep -E 'stat::number_of_executed|ERROR|SUMMARY|panicked|Test unit' || found=${PIPESTATUS[0]}
    [[ $found -eq 0 ]] || exit 1
done
