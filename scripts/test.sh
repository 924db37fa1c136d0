#!/usr/bin/env bash
# All checks on a fresh machine: sets up, then style, import contracts, and the tests beside the types. Arguments go to pytest.
set -euo pipefail
cd "$(dirname "$0")/.."
bash scripts/setup.sh dev
export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 MKL_NUM_THREADS=1
unset PYTHONDONTWRITEBYTECODE # the tests start hundreds of processes: each would compile the sources anew
.venv/bin/ruff check .
.venv/bin/ruff format --check .
.venv/bin/lint-imports --no-cache
export GEARFE_CACHE="${GEARFE_CACHE:-$(pwd -P)/.test_cache}" # as in tests/conftest.py
types="$(mktemp)"
trap 'rm -f "$types"' EXIT
.venv/bin/mypy >"$types" 2>&1 &
typed=$! failed=0
# Beside the types, on the other core: the kernels that the tests share. Each worker would compile them for itself.
{
    .venv/bin/gearfe cache --compile
    .venv/bin/gearfe vibration geometry/gear_train.toml --no-pictures --no-estimate --no-floquet --quiet \
        --set train.housing=rigid --set train.duration_ms=0.1 --out out/test
} >/dev/null || echo "the kernels were not compiled: the tests report why"
.venv/bin/python -m pytest -n 2 --dist worksteal -m "not slow" --durations=10 "$@" || failed=$?
wait "$typed" || failed=$?
cat "$types"
exit "$failed"
