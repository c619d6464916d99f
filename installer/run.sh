#!/usr/bin/env bash
# Installs what is missing and calibrates the simulated headset, with no hardware or display.
set -euo pipefail
source "$(dirname "${BASH_SOURCE[0]}")/setup.sh"

export OMP_NUM_THREADS=1 # two threads on two busy cores are slower than one
output=results/demo
mkdir -p "$output"
.venv/bin/handcal demo --seed 1 --eyes each --output "$output" --json "$output/demo.json" "$@"
echo "Results: $root/$output"
