#!/usr/bin/env bash
# Makes the virtual environment .venv with gearfe in it; on Debian/Ubuntu also the shared libraries that the gmsh and VTK
# wheels load. Usage: bash scripts/setup.sh [dev]   (dev adds the test tools). Safe to run again: it does only what is missing.
set -euo pipefail
cd "$(dirname "$0")/.."
extras="${1:-all}"

python=""
for candidate in "${PYTHON:-}" python3 python3.14 python3.13 python3.12 python3.11; do
    if [ -n "$candidate" ] && command -v "$candidate" >/dev/null 2>&1 &&
        "$candidate" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null; then python="$candidate"; break; fi
done
if [ -z "$python" ]; then
    echo "gearfe needs Python 3.11 or newer; install it, or name it: PYTHON=/path/to/python bash $0" >&2; exit 1
fi

packages=()
need() { # need LIBRARY PACKAGE: the shared library, or else the Debian package that brings it
    # the output is held in a variable: with pipefail, grep -q closing the pipe early would count as a failure
    case "$ldconfig_list" in *"$1"*) ;; *) packages+=("$2") ;; esac
}
if [ "$(uname -s)" = Linux ]; then
    ldconfig_list="$( (ldconfig -p || /sbin/ldconfig -p) 2>/dev/null || true)"
    need libGLU.so.1 libglu1-mesa; need libGL.so.1 libgl1; need libEGL.so.1 libegl1; need libXft.so.2 libxft2
    need libXcursor.so.1 libxcursor1; need libXinerama.so.1 libxinerama1; need libgomp.so.1 libgomp1
    "$python" -c 'import ensurepip, venv' 2>/dev/null || packages+=("python3-venv")
fi
if [ "${#packages[@]}" -gt 0 ]; then
    if command -v apt-get >/dev/null 2>&1; then
        sudo=""; if [ "$(id -u)" -ne 0 ]; then sudo="sudo"; fi
        if [ -n "$sudo" ] && ! command -v sudo >/dev/null 2>&1; then
            echo "please install as root, then run this again: apt-get install ${packages[*]}" >&2; exit 1
        fi
        echo "installing system libraries: ${packages[*]}"
        $sudo apt-get update -qq
        # a fresh machine may be updating itself: wait for its lock
        DEBIAN_FRONTEND=noninteractive $sudo apt-get install -y -qq --no-install-recommends -o DPkg::Lock::Timeout=300 "${packages[@]}" >/dev/null
    else
        echo "warning: gmsh and off-screen rendering need the libraries that Debian calls ${packages[*]};" \
             "install them with your system's package manager" >&2
    fi
fi

# A half-made environment (an interrupted first run) has no pip: create it again.
if ! .venv/bin/python -m pip --version >/dev/null 2>&1; then
    rm -rf .venv
    "$python" -m venv .venv
fi
stamp=".venv/.gearfe-$(cksum pyproject.toml | tr ' ' '-' | cut -c1-24)-$extras"
if [ ! -e "$stamp" ]; then
    echo "installing gearfe into .venv (a few minutes the first time); a line for each package:"
    PYTHONUNBUFFERED=1 .venv/bin/python -m pip install --disable-pip-version-check --progress-bar off -e ".[$extras]" |
        while IFS= read -r line; do
            case "$line" in Collecting*|Building*|Installing*|Successfully*) echo "  ${line:0:100}" ;; esac
        done
    touch "$stamp"
fi
