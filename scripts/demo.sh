#!/usr/bin/env bash
# The shipped gear pair end to end on a fresh machine: sets up, then computes curve and pictures into out/demo.
set -euo pipefail
cd "$(dirname "$0")/.."
bash scripts/setup.sh
.venv/bin/gearfe stiffness geometry/gear_train.toml --out out/demo
echo "results are in out/demo: stiffness.csv, stiffness.png, summary.json"
