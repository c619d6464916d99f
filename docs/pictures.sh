#!/usr/bin/env bash
# Takes pictures of the program, which operates itself on an X display without a screen.
#
#   docs/pictures.sh         the guide's pictures, in docs/pictures/
#   docs/pictures.sh looks   every step, panel and dialog on the screens and in the colours that
#                            people use, in artefacts/looks/, to be looked at
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
export PATH="$PWD/.venv/bin:$PATH" OMP_NUM_THREADS=1
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

# take FOLDER WIDTH HEIGHT THEME SCALE: pictures of a window that fills a screen of so many pixels.
take() {
    local folder=$1 width=$2 height=$3 theme=$4 scale=$5
    echo "{\"version\": 4, \"theme\": \"$theme\"}" >"$scratch/preferences.json"
    QT_SCALE_FACTOR=$scale xvfb-run --auto-servernum \
        --server-args="-screen 0 ${width}x${height}x24" \
        handcal-gui --screenshots "$folder" --output "$scratch/output" \
        --preferences "$scratch/preferences.json" --size "$((width / scale))x$((height / scale))" --seed 3
}

case "${1:-guide}" in
guide)
    take "$scratch/pictures" 1280 800 light 1
    mkdir -p docs/pictures
    for picture in $(grep -oh 'pictures/[a-z0-9-]*\.png' docs/guide.md README.md | sort -u); do
        # Open3D's window is not part of the tour; its picture stays.
        if [ -f "$scratch/$picture" ]; then cp "$scratch/$picture" docs/pictures/; fi
    done
    python docs/moving_picture.py "$scratch/pictures"
    ;;
looks)
    for theme in light dark; do
        take "artefacts/looks/1280x720-$theme" 1280 720 "$theme" 1
        take "artefacts/looks/1366x768-$theme" 1366 768 "$theme" 1
        take "artefacts/looks/1920x1080-200-percent-$theme" 1920 1080 "$theme" 2
        take "artefacts/looks/3840x2160-$theme" 3840 2160 "$theme" 1
    done
    take artefacts/looks/1366x768-contrast 1366 768 contrast 1
    ;;
*)
    echo "pictures.sh: there is nothing but guide and looks" >&2
    exit 2
    ;;
esac
