#!/usr/bin/env bash
# Makes the guide's pictures anew: the program, on an X display without a screen, by itself.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
export PATH="$PWD/.venv/bin:$PATH" OMP_NUM_THREADS=1
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
xvfb-run --auto-servernum --server-args="-screen 0 1280x800x24" \
    handcal-gui --screenshots "$scratch/pictures" --output "$scratch/output" \
    --preferences "$scratch/preferences.json" --size 1280x800 --seed 3
mkdir -p docs/pictures
for picture in $(grep -o 'pictures/[a-z0-9-]*\.png' docs/guide.md | sort -u); do
    cp "$scratch/$picture" docs/pictures/
done
