#!/usr/bin/env bash
# Prints Newton iterations a step (median, worst) for each normal law as a Markdown table: the square of Wang and Cheng
# (2022) at h = 1/32 and 1/128. Needs python3 and the built solver. SIZES="32" takes other numbers of cells.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
solver=${SOLVER:-target/release/solver}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
laws=(
    "damped_response, even|damped_response = { breakpoints = [0.003, 0.005], slopes = [10.0, -10.0, 10.0], symmetry = 'even' }"
    "damped_response, odd|damped_response = { breakpoints = [0.003, 0.005], slopes = [10.0, -10.0, 10.0], symmetry = 'odd' }"
    "damped_response, one_sided|damped_response = { breakpoints = [0.003, 0.005], slopes = [10.0, -10.0, 10.0], symmetry = 'one_sided' }"
    "graph with jumps|graph = { points = [[-0.003, -5.0], [-0.003, -2.0], [0.0, -2.0], [0.0, 2.0], [0.003, 2.0], [0.003, 5.0]], slope_before = 10.0, slope_after = 10.0 }"
    "compliance, exponent 1|compliance = { stiffness = 500.0, exponent = 1.0, gap = 0.005 }"
    "compliance, exponent 1.5|compliance = { stiffness = 5000.0, exponent = 1.5, gap = 0.005 }"
    "unilateral, displacement|unilateral = { gap = 0.005 }"
    "steep one-sided damper|graph = { points = [[0.0, 0.0]], slope_before = 0.0, slope_after = 1e6 }"
)
echo '| law | h | steps | median | worst |'
echo '|---|---|---|---|---|'
for cells in ${SIZES:-32 128}; do
    for law in "${laws[@]}"; do
        python3 - "$work/job.toml" "$cells" "${law#*|}" <<'PYTHON'
import re, sys
file, cells, law = sys.argv[1:]
job = open("jobs/papers/wang_cheng_2022.toml").read().split("[output]")[0]
job = re.sub(r"cells\s*=.*", f"cells = [{cells}, {cells}]", job)
job = re.sub(r"\[contact\.normal\.damped_response\].*?\n\n", f"[contact.normal]\n{law}\n\n", job, flags=re.S)
open(file, "w").write(job + '[output]\nfolder = "out"\n')
PYTHON
        if "$solver" run "$work/job.toml" --force > "$work/log" 2>&1; then
            python3 - "$work/out/history.csv" "${law%%|*}" "$cells" <<'PYTHON'
import csv, statistics, sys
counts = [int(row["newton_iterations"]) for row in csv.DictReader(open(sys.argv[1]))]
print(f"| {sys.argv[2]} | 1/{sys.argv[3]} | {len(counts)} | {statistics.median(counts):g} | {max(counts)} |")
PYTHON
        else
            echo "| ${law%%|*} | 1/$cells | failed: $(grep -m1 '^error' "$work/log") | | |"
        fi
    done
done
