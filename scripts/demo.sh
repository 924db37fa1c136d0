#!/usr/bin/env bash
# The shipped gear train end to end on a fresh machine: sets up, then computes the stiffness curve of the gear pair and the
# vibration of the train in its elastic housing, with pictures, into out/demo.
set -euo pipefail
cd "$(dirname "$0")/.."
bash scripts/setup.sh
.venv/bin/gearfe stiffness geometry/gear_train.toml --out out/demo/stiffness
.venv/bin/gearfe vibration geometry/gear_train.toml --out out/demo/vibration
echo "results are in out/demo: stiffness (curve) and vibration (contact forces, housing acceleration, spectrum, sound)"
