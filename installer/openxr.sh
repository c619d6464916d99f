#!/usr/bin/env bash
# Builds the OpenXR layer into a folder, by default where handcal looks for it:
#   bash installer/openxr.sh [FOLDER]
# Needs a C compiler and OpenXR's headers (gcc, libopenxr-dev); the layer for Windows is built if its
# compiler is there (gcc-mingw-w64-x86-64).
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
folder=${1:-resources/openxr}
headers=$(mktemp -d) # of OpenXR alone: the system's others are not for Windows
trap 'rm -r "$headers"' EXIT
if ! command -v cc >/dev/null || [[ ! -e /usr/include/openxr/openxr.h ]]; then
    echo "openxr: a C compiler or OpenXR's headers are missing; run apt-get install gcc libopenxr-dev" >&2
    exit 1
fi
ln -s /usr/include/openxr "$headers"
flags=(-std=gnu11 -O2 -s -Wall -Wextra -shared -fvisibility=hidden -I"$headers" resources/openxr/*.c)
# By its name an application finds the library that the loader has loaded.
cc -fPIC -Wl,-soname,libhandcal_openxr.so -o "$folder/libhandcal_openxr.so" "${flags[@]}" -lm
if command -v x86_64-w64-mingw32-gcc >/dev/null; then
    x86_64-w64-mingw32-gcc -static-libgcc -o "$folder/handcal_openxr.dll" "${flags[@]}"
fi
