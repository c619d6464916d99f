#!/usr/bin/env bash
# Takes pictures of the program, which operates itself on an X display without a screen.
#
#   docs/pictures.sh         the guide's pictures anew, in docs/pictures/
#   docs/pictures.sh looks   every step, panel and dialog at the sizes, in the colours and at the
#                            scaling that people use, in artefacts/looks/, to be looked at
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
export PATH="$PWD/.venv/bin:$PATH" OMP_NUM_THREADS=1
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT

# take FOLDER WIDTH HEIGHT THEME SCALE: pictures of a window that fills a screen, in logical pixels.
take() {
    local folder=$1 width=$2 height=$3 theme=$4 scale=$5
    echo "{\"theme\": \"$theme\"}" >"$scratch/preferences.json"
    QT_SCALE_FACTOR=$scale xvfb-run --auto-servernum \
        --server-args="-screen 0 $((width * scale))x$((height * scale))x24" \
        handcal-gui --screenshots "$folder" --output "$scratch/output" \
        --preferences "$scratch/preferences.json" --size "${width}x${height}" --seed 3
}

case "${1:-guide}" in
guide)
    take "$scratch/pictures" 1280 800 light 1
    mkdir -p docs/pictures
    for picture in $(grep -o 'pictures/[a-z0-9-]*\.png' docs/guide.md | sort -u); do
        # Open3D's window is not part of the tour; its picture stays.
        if [ -f "$scratch/$picture" ]; then cp "$scratch/$picture" docs/pictures/; fi
    done
    ;;
looks)
    for theme in light dark; do
        take "artefacts/looks/1280x800-$theme" 1280 800 "$theme" 1
        take "artefacts/looks/1920x1080-$theme" 1920 1080 "$theme" 1
        take "artefacts/looks/200-percent-$theme" 1280 800 "$theme" 2
    done
    ;;
*)
    echo "pictures.sh: there is nothing but guide and looks" >&2
    exit 2
    ;;
esac
