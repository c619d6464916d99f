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
# OpenGL, and Qt's windows the libraries of X11. Each is a library, program or file, and Debian's
# package of it. Packages are renamed, as libglib2.0-0 on Debian 13; apt-get knows the former name.
system_needs=(
    python3=python3 libusb-1.0.so.0=libusb-1.0-0 libudev.so.1=libudev1 libGL.so.1=libgl1
    libEGL.so.1=libegl1 libX11.so.6=libx11-6 libX11-xcb.so.1=libx11-xcb1 libidn2.so.0=libidn2-0
    libglib-2.0.so.0=libglib2.0-0 libfontconfig.so.1=libfontconfig1 libdbus-1.so.3=libdbus-1-3
    libxkbcommon.so.0=libxkbcommon0 libxkbcommon-x11.so.0=libxkbcommon-x11-0
    libxcb-cursor.so.0=libxcb-cursor0 libxcb-icccm.so.4=libxcb-icccm4
    libxcb-image.so.0=libxcb-image0 libxcb-keysyms.so.1=libxcb-keysyms1
    libxcb-randr.so.0=libxcb-randr0 libxcb-render-util.so.0=libxcb-render-util0
    libxcb-shape.so.0=libxcb-shape0 libxcb-xkb.so.1=libxcb-xkb1 libxcb-shm.so.0=libxcb-shm0
    libxcb-sync.so.1=libxcb-sync1 libxcb-xfixes.so.0=libxcb-xfixes0
    /usr/share/fonts/truetype/dejavu/DejaVuSans.ttf=fonts-dejavu-core
    ${test_needs[@]+"${test_needs[@]}"}
)

# Prints the packages of what is not there.
missing_packages() {
    local libraries need
    libraries=$(PATH=$PATH:/usr/sbin:/sbin ldconfig -p)
    for need in "${system_needs[@]}"; do
        case ${need%=*} in
        /*) [[ -e ${need%=*} ]] ;;
        *.so.*) [[ $libraries == *[[:space:]]"${need%=*} (libc6,"* ]] ;; # 64 bits: 32 have no comma
        *) command -v "${need%=*}" >/dev/null ;;
        esac || echo "${need#*=}"
    done
    python3 -c 'import venv, ensurepip' 2>/dev/null || echo python3-venv
}

install_system_packages() {
    local missing
    mapfile -t missing < <(missing_packages)
    [[ ${#missing[@]} -eq 0 ]] && return
    command -v apt-get >/dev/null || {
        echo "handcal: not a Debian system; these must be there: ${missing[*]}" >&2
        return
    }
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
