#!/bin/bash
# Called by cargo in place of rustc: adds libFuzzer's coverage to the solver and the fuzz targets. The other crates are those of `cargo build
# --release`, which need not be compiled again.
set -euo pipefail
rustc=$1
shift
flags=()
case " $* " in
*" --crate-name clarke_core "* | *" --crate-name job "* | *" --crate-name mesh "* | *" --crate-name checkpoint "*)
    flags=(-Cpasses=sancov-module -Clink-dead-code)
    for argument in level=4 inline-8bit-counters pc-table trace-compares; do
        flags+=("-Cllvm-args=-sanitizer-coverage-$argument")
    done
    ;;
esac
exec "$rustc" "$@" "${flags[@]}"
