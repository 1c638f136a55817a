#!/usr/bin/env bash
# Prints the certificates of all jobs under jobs/ as one Markdown table. Needs python3 and the built solver.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
solver=${SOLVER:-target/release/solver}
columns='theta theta_step viscosity_modulus monotonicity_constant growth_constants trace_norm_squared slip_pressure_bound explicit_step_bound'
echo "| job | ${columns// / | } |"
echo '|---|---|---|---|---|---|---|---|---|'
find jobs -name '*.toml' -not -path '*/out/*' -not -path '*/studies/*' | sort | while read -r job; do
    "$solver" check "$job" --json | python3 -c '
import json, sys
name, columns = sys.argv[1], sys.argv[2].split()
found = json.load(sys.stdin)
found = found.get("certificates", found)
show = lambda x: "-" if x is None else ", ".join(map(show, x)) if isinstance(x, list) else f"{x:.4g}"
print("|", name, "|", " | ".join(show(found.get(column)) for column in columns), "|")' "$job" "$columns"
done
