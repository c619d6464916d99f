#!/usr/bin/env bash
# Installs what is missing, then runs every check, all tests but those marked slow or campaign, and
# the short form of every campaign.
# Arguments go to pytest: -m quick for a check within two minutes, -m "" for every test.
set -euo pipefail
lock=installer/requirements.lock # everything, also what the checks and the extras need
# Real windows on a virtual screen, PDF pages, the headset's program in C#, sockets that are opened,
# a Turkish locale, faults of system calls, the OpenXR layer for both systems and its validation,
# OpenGL without a graphics card.
test_needs=(
    Xvfb=xvfb xauth=xauth xdotool=xdotool pdftoppm=poppler-utils mcs=mono-mcs mono=mono-runtime
    strace=strace /usr/share/i18n/locales/tr_TR=locales cc=gcc
    /usr/include/stdio.h=libc6-dev /usr/include/openxr/openxr.h=libopenxr-dev
    libopenxr_loader.so.1=libopenxr-loader1 x86_64-w64-mingw32-gcc=gcc-mingw-w64-x86-64
    /usr/lib/x86_64-linux-gnu/openxr/1/api_layers/libXrApiLayer_core_validation.so=openxr-layer-corevalidation
    libGL.so.1=libgl1 /usr/lib/x86_64-linux-gnu/dri/swrast_dri.so=libgl1-mesa-dri
)
source "$(dirname "${BASH_SOURCE[0]}")/setup.sh"

export HANDCAL_REQUIRE_MONO=1 HANDCAL_REQUIRE_OPENXR=1 # installed above: no test may be skipped for want of it
export OMP_NUM_THREADS=1 # two threads on two busy cores are slower than one
export PATH="$root/.venv/bin:$PATH"
ruff check
ruff format --check
mypy
lint-imports
pytest -n 3 "$@" # three, as each waits for a fifth of its time
python -m tests.campaigns --short
