#!/usr/bin/env bash
# Build the source archive and all wheels of a release: .github/wheels.sh FOLDER
#
# The plain wheel is for all platforms and compiles its loops with numba; in addition, one wheel per platform contains
# compiled loops. These are compiled once, for all platforms, into FOLDER/kernels. The same sources give the same bytes in
# any directory:
#
#   .github/wheels.sh one && git worktree add /tmp/other && (cd /tmp/other && .github/wheels.sh two)
#   sha256sum one/*.whl /tmp/other/two/*.whl
#
# Required in the environment of `python`: pip install . build hatchling lief
set -euo pipefail
mkdir -p "$1"
folder=$(cd "$1" && pwd)
cd "$(dirname "$0")/.."
SOURCE_DATE_EPOCH=$(git log -1 --format=%ct)
export SOURCE_DATE_EPOCH TDINT_KERNELS_DIR="$folder/kernels"

# shellcheck disable=SC2054 # a list of targets is one element
platforms=(
    linux-x86-64-v2,linux-x86-64-v3
    linux-aarch64
    macos-x86-64-v2
    macos-aarch64
    windows-x86-64-v2
)
targets=$(IFS=, && echo "${platforms[*]}")
PYTHONPATH=src:cli python -m tdint_cli compile --all --target "$targets" -o "$TDINT_KERNELS_DIR"
python -m build --no-isolation --outdir "$folder"
for platform in "${platforms[@]}"; do
    TDINT_WHEEL_TARGETS=$platform python -m build --no-isolation --wheel --outdir "$folder"
done
