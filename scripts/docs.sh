#!/usr/bin/env bash
# Builds the documentation site into out/site (open out/site/index.html); a dead link, a missing page or anchor fails it.
# Usage: bash scripts/docs.sh [serve]
set -euo pipefail
cd "$(dirname "$0")/.."
bash scripts/setup.sh dev
export NO_MKDOCS_2_WARNING=1 DISABLE_MKDOCS_2_WARNING=true
if [ "${1:-}" = serve ]; then exec .venv/bin/mkdocs serve; fi
.venv/bin/mkdocs build --quiet
echo "written: out/site/index.html (its search needs a server: bash scripts/docs.sh serve)"
