#!/usr/bin/env bash
# Draws the pictures of jobs in README.md: runs each job that has one in docs/pictures/jobs, and copies the thumbnail of its
# report; then the picture at the top, from a finer mesh.
#
#     scripts/gallery.sh target/release/solver
set -euo pipefail

solver=$(realpath "$1")
cd "$(dirname "${BASH_SOURCE[0]}")/.."
out=$(mktemp -d)
trap 'rm -rf "$out"' EXIT

# Runs a job with these options and writes its report.
report() {
    mpirun -n 2 "$solver" run "$1" --quiet --set output.folder="$out/$2" "${@:3}"
    "$solver" report "$out/$2"
}

grep -o 'docs/pictures/jobs/[a-z_0-9]*' README.md | while read -r picture; do
    name=$(basename "$picture")
    report "$(find jobs -name "$name.toml")" "$name" < /dev/null
    cp "$out/$name/report/thumbnail.png" "$picture.png"
done
report jobs/stamped_block.toml fine --set 'mesh.box.cells=[48,24,12]'
cp "$out/fine/report/von_mises.png" docs/pictures/stamped_block.png
