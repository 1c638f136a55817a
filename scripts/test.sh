#!/usr/bin/env bash
# Every test, those of the Python package among them, beside random input for the readers of files; then the slowest tests, and the summaries of all tests.
#
#   scripts/test.sh [--write]        --write puts the slowest tests into docs/tests.md
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
logs=${CARGO_TARGET_DIR:-target}/tmp
mkdir -p "$logs"

fuzz/run.sh 20 >"$logs/random-input.log" 2>&1 &
random_input=$!

# What each test takes is told by an unstable option of libtest, which this variable allows.
timed() {
    cargo --config "target.'cfg(all())'.runner = ['env', 'RUSTC_BOOTSTRAP=1']" "$@" -- -Zunstable-options --report-time
}

# With OMP_NUM_THREADS, which the Makefile sets, nproc would print that number.
cores=$(env -u OMP_NUM_THREADS nproc)
# More tests than cores at a time: tests wait for launchers of ranks, too, and runs take turns on the cores (tests/cores.rs).
export RUST_TEST_THREADS=${RUST_TEST_THREADS:-$((2 * cores))}

failed=()
{
    timed --config scripts/unit-tests.toml test --release --locked --lib --package clarke-core &&
        timed --config scripts/unit-tests-of-program.toml test --release --locked --lib --package clarke &&
        timed test --release --locked --test all &&
        cargo test --release --locked --doc &&
        CLARKE_SOLVER=$(realpath "${CARGO_TARGET_DIR:-target}")/release/solver \
            python3 -m unittest discover -b -v -s python/tests -t python
} 2>&1 | tee "$logs/tests.log" || failed+=('the tests')
wait "$random_input" || failed+=("random input ($logs/random-input.log)")
echo 'Random input:'
cat "$logs/random-input.log"

slowest() {
    sed -nE 's/^test (.*) \.\.\. ok <([0-9.]+)s>$/\2 \1/p' "$logs/tests.log" | sort -rn | sed -n 1,20p
}
echo 'The slowest tests, in seconds:'
slowest

if [[ ${1:-} == --write ]]; then
    page=docs/tests.md
    machine="$cores cores of $(sed -n '/^model name/{s/.*: //p;q}' /proc/cpuinfo)"
    {
        sed '/^<!-- table slowest -->$/q' $page
        printf '`make test ARGS=--write` on %s, %s:\n\n| test | s |\n|---|---|\n' "$machine" "$(date --utc +%F)"
        slowest | while read -r seconds name; do printf '| %s | %s |\n' "$name" "$seconds"; done
        printf '\n'
        sed -n '/^<!-- end of table slowest -->$/,$p' $page
    } >"$logs/tests.md"
    mv "$logs/tests.md" $page
fi
for part in "${failed[@]}"; do
    echo "FAILED: $part"
done
grep '^test result' "$logs/tests.log"
[[ ${#failed[@]} -eq 0 ]]
