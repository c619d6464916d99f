#!/usr/bin/env bash
# Installs what is missing and calibrates a simulated headset, with no hardware: in a window that
# operates itself, or without one where there is no display.
set -euo pipefail
lock=installer/requirements-run.lock
source "$(dirname "${BASH_SOURCE[0]}")/setup.sh"

export OMP_NUM_THREADS=1 # two threads on two busy cores are slower than one
output=results/demo
mkdir -p "$output"
if [[ -n ${DISPLAY:-}${WAYLAND_DISPLAY:-} ]]; then
    .venv/bin/handcal-gui --source simulator --autopilot --output "$output" "$@"
    .venv/bin/handcal solve "$(find "$output" -maxdepth 1 -name 'session-*' | sort | tail -n 1)"
else
    .venv/bin/handcal demo --seed 1 --plan recommended --output "$output" --json "$output/demo.json" "$@"
    session=$(.venv/bin/python -c "import json, sys; print(json.load(open(sys.argv[1]))['session'])" "$output/demo.json")
    .venv/bin/handcal export "$session" --output "$output/export"
fi
report=$(find "$output" -name report.html -printf '%T@ %p\n' | sort -n | tail -n 1 | cut -d' ' -f2-)
echo "Results: $root/$output"
echo "Report: $root/$report"
