# Brings .venv up to date with $lock; sourced by run.sh and test.sh.
# shellcheck shell=bash
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
root=$PWD

fail() {
    echo "handcal: $*" >&2
    exit 1
}

# What the wheels load from the system: librealsense needs libusb and udev, Open3D and Qt need
# OpenGL, and Qt's windows the libraries of X11. A caller may ask for more in test_packages.
apt_packages=(
    python3 python3-venv
    libusb-1.0-0 libudev1 libgl1 libegl1 libx11-6 libidn2-0
    libglib2.0-0 libfontconfig1 libdbus-1-3 libxkbcommon0 libxkbcommon-x11-0 fonts-dejavu-core
    libxcb-cursor0 libxcb-icccm4 libxcb-image0 libxcb-keysyms1 libxcb-randr0 libxcb-render-util0
    libxcb-shape0 libxcb-xkb1 libxcb-shm0 libxcb-sync1 libxcb-xfixes0 libx11-xcb1
    ${test_packages[@]+"${test_packages[@]}"}
)

install_system_packages() {
    command -v dpkg-query >/dev/null || {
        echo "handcal: not a Debian system; these must be there: ${apt_packages[*]}" >&2
        return
    }
    local missing=() package
    for package in "${apt_packages[@]}"; do
        dpkg-query -W -f '${Status}' "$package" 2>/dev/null | grep -q 'ok installed' ||
            missing+=("$package")
    done
    [[ ${#missing[@]} -eq 0 ]] && return
    local as_root=()
    if [[ $EUID -ne 0 ]]; then
        command -v sudo >/dev/null || fail "as root, run: apt-get install ${missing[*]}"
        as_root=(sudo)
    fi
    echo "Installing system packages: ${missing[*]}"
    "${as_root[@]}" apt-get update -qq &&
        "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive \
            apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null ||
        fail "apt-get failed; is this computer online? Needed: ${missing[*]}"
}

find_python() {
    local python
    for python in python3 python3.13 python3.12 python3.11; do
        if "$python" -c 'import sys, venv, ensurepip
sys.exit(not (3, 11) <= sys.version_info < (3, 14))' 2>/dev/null; then
            command -v "$python"
            return
        fi
    done
    fail "Python 3.11, 3.12 or 3.13 is needed; found $(python3 --version 2>&1 || true)"
}

install_python_packages() {
    local stamp=.venv/handcal.stamp state python
    state=$(cat installer/*.lock pyproject.toml | sha256sum)
    # A virtual environment names its folder and does not survive a move.
    if ! .venv/bin/python -c '' 2>/dev/null || ! grep -q " $root/.venv$" .venv/pyvenv.cfg; then
        python=$(find_python)
        "$python" -m venv --clear .venv
    # The development lock holds all of the other.
    elif grep -qxF -e "$state $lock" -e "$state installer/requirements.lock" "$stamp" 2>/dev/null; then
        return
    fi
    echo "Installing Python packages into .venv (a few hundred MB the first time)"
    local pip=(.venv/bin/python -m pip --disable-pip-version-check --quiet)
    "${pip[@]}" install --require-hashes -r "$lock" ||
        fail "the packages could not be installed; is this computer online?"
    "${pip[@]}" install --no-deps --no-build-isolation -e . || fail "handcal itself could not be installed"
    echo "$state $lock" >"$stamp"
}

install_system_packages
install_python_packages
