#!/usr/bin/env bash
# Builds what is given to users, in dist/:
#   bash installer/build.sh wheel      handcal-VERSION-py3-none-any.whl
#   bash installer/build.sh deb        handcal_VERSION_amd64.deb, for Debian and Ubuntu
#   bash installer/build.sh deb-open3d handcal-open3d_VERSION_amd64.deb, the same with Open3D
#   bash installer/build.sh windows    handcal-setup-VERSION.exe, for Windows 10 and 11, and
#                                      handcal-open3d-VERSION-windows.zip, to unpack beside it
#   bash installer/build.sh all
# Runs on Debian 12 or newer with Python 3.11 to 3.13 (PYTHON names another than python3). All need
# gcc, gcc-mingw-w64-x86-64 and libopenxr-dev for the OpenXR layer; deb needs binutils and
# libpython3.X, windows needs nsis, zip and unzip. docs/platforms.md says what was measured.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
work=$PWD/dist/work
python=$work/venv/bin/python

fail() {
    echo "build: $*" >&2
    exit 1
}

require() {
    command -v "$1" >/dev/null || fail "$1 is missing; run apt-get install $2"
}

# Each is asked for what its programs need before anything is built, which takes minutes.
needs_wheel() {
    require cc gcc
    require x86_64-w64-mingw32-gcc gcc-mingw-w64-x86-64
    [[ -e /usr/include/openxr/openxr.h ]] ||
        fail "OpenXR's headers are missing; run apt-get install libopenxr-dev"
}

needs_deb() {
    require objdump binutils
    # PyInstaller bundles Python's shared library, which Debian's python3 runs without.
    local library
    library=$("${PYTHON:-python3}" -c 'import sys; print("libpython%d.%d" % sys.version_info[:2])')
    "${PYTHON:-python3}" -c 'import ctypes, os, sys, sysconfig
name = sys.argv[1] + ".so.1.0"
path = os.path.join(sysconfig.get_config_var("LIBDIR"), name)
ctypes.CDLL(path if os.path.exists(path) else name)' "$library" 2>/dev/null ||
        fail "$library.so.1.0 is missing; run apt-get install $library"
}

needs_deb-open3d() { needs_deb; }

needs_windows() {
    require makensis nsis
    require unzip unzip
    require zip zip
}

# Installs the tools and the packages of a lock by their hashes: make_environment FOLDER LOCK
make_environment() {
    local folder=$1 lock=$2 state
    state=$(sha256sum <"$lock")
    [[ -x $folder/bin/python && $(cat "$folder/state" 2>/dev/null) == "$state" ]] && return
    "${PYTHON:-python3}" -m venv --clear "$folder"
    "$folder/bin/python" -m pip --disable-pip-version-check --quiet install --require-hashes \
        -r "$lock" || fail "the packages could not be installed; is this computer online?"
    echo "$state" >"$folder/state"
}

build_wheel() {
    rm -f dist/handcal-*.whl
    bash installer/openxr.sh # into resources, which the wheel carries
    "$python" -m hatchling build -t wheel -d dist
    wheel=$(echo dist/handcal-*.whl)
    version=$("$python" -m hatchling version)
}

build_deb() {
    make_deb handcal "$python" handcal-open3d "Inspect in 3D is in handcal-open3d"
}

build_deb-open3d() {
    make_environment "$work/venv-open3d" installer/requirements-open3d.lock
    make_deb handcal-open3d "$work/venv-open3d/bin/python" handcal "With Open3D for Inspect in 3D"
}

# make_deb PACKAGE PYTHON OTHER SENTENCE: of the packages of a Python, in place of another package.
make_deb() {
    local package=$1 python=$2 other=$3 sentence=$4 root=$work/deb depends size
    "$python" -m pip --quiet install --no-deps --force-reinstall "$wheel"
    # Elsewhere, so that it finds the installed program and not the checkout.
    (cd "$work" && "$python" -m PyInstaller --noconfirm --log-level WARN --distpath "$work" \
        --workpath "$work/pyinstaller" "$OLDPWD/installer/linux/handcal.spec")
    rm -rf "$root"
    install -d "$root"/{DEBIAN,opt,usr/bin,usr/share/doc/handcal}
    cp -a "$work/handcal" "$root/opt/handcal"
    "$python" installer/licences.py "$root/opt/handcal/licences"
    ln -s /opt/handcal/handcal-gui "$root/usr/bin/handcal-gui"
    ln -s /opt/handcal/handcal-gui "$root/usr/bin/handcal" # the name makes it the command line
    install -Dm644 installer/linux/handcal.desktop -t "$root/usr/share/applications"
    install -Dm644 installer/linux/handcal.bash "$root/usr/share/bash-completion/completions/handcal"
    install -Dm644 resources/icons/handcal.svg -t "$root/usr/share/icons/hicolor/scalable/apps"
    install -Dm644 installer/linux/60-handcal-realsense.rules -t "$root/lib/udev/rules.d"
    cat LICENSE THIRD-PARTY.md >"$root/usr/share/doc/handcal/copyright"
    depends=$(system_packages "$root/opt/handcal")
    size=$(du -sk "$root" | cut -f1)
    cat >"$root/DEBIAN/control" <<CONTROL
Package: $package
Conflicts: $other
Replaces: $other
Version: $version
Architecture: amd64
Maintainer: the handcal authors <handcal@localhost>
Installed-Size: $size
Depends: $depends, libgl1, libegl1, fonts-dejavu-core
Section: science
Priority: optional
Description: calibrate an optical see-through headset with the wearer's bare hand
 A window (handcal-gui) and a command line (handcal), with a simulator that needs no hardware.
 $sentence.
CONTROL
    dpkg-deb --root-owner-group -Zzstd -z9 --build "$root" "dist/${package}_${version}_amd64.deb"
}

# Prints the packages of the system's libraries that the bundle loads, for the control file.
system_packages() {
    local files glibc needed packages
    files=$(find "$1" -type f \( -name '*.so*' -o -name handcal-gui \))
    glibc=$(objdump -T $files | grep -o 'GLIBC_2\.[0-9.]*' | sort -uV | tail -1)
    needed=$(objdump -p $files | awk '$1 == "NEEDED" { print $2 }' | sort -u)
    packages=$(for library in $needed; do
        [[ -n $(find "$1" -name "$library" -print -quit) || $library == ld-linux* ]] && continue
        path=$(ldconfig -p | awk -v name="$library" '$1 == name { print $NF; exit }')
        dpkg-query -S "*/${path##*/}" 2>/dev/null | grep -m1 -o '^[^:]*' ||
            fail "$library is missing; install it, so that its package becomes a dependency"
    done | sort -u | grep -vx libc6)
    echo "libc6 (>= ${glibc#GLIBC_}), $(echo "$packages" | paste -sd, | sed 's/,/, /g')"
}

build_windows() {
    local root=$work/windows open3d=$work/handcal-open3d file=handcal-open3d-$version-windows.zip
    rm -rf "$root" "$open3d" "dist/$file"
    mkdir -p "$root" "$open3d"
    "$python" installer/windows/requirements.py installer/requirements-build.lock \
        installer/requirements-open3d.lock "$root"
    download "$root/requirements.txt" "$root/wheels"
    download "$root/requirements-open3d.txt" "$open3d"
    download "$root/tools.txt" "$root"
    "$python" installer/licences.py "$open3d/licences" "$open3d"/*.whl
    (cd "$work" && zip -qr0 "$OLDPWD/dist/$file" handcal-open3d) # wheels are compressed already
    cp "$wheel" "$root/wheels"
    "$python" installer/licences.py "$root/licences" "$root"/wheels/*.whl "$root"/uv-*.whl
    unzip -qjo "$root"/uv-*.whl '*/scripts/uv.exe' -d "$root"
    rm "$root"/uv-*.whl "$root/tools.txt"
    cp installer/windows/setup-environment.cmd "$root"
    QT_QPA_PLATFORM=offscreen "$python" -c "$(printf '%s\n' \
        'import sys' 'from PySide6.QtGui import QGuiApplication, QIcon' \
        'app = QGuiApplication([])' \
        'sys.exit(not QIcon(sys.argv[1]).pixmap(256, 256).save(sys.argv[2]))')" \
        resources/icons/handcal.svg "$root/handcal.ico"
    makensis -V2 -DVERSION="$version" -DPAYLOAD="$root" -DOUTPUT="$PWD/dist/handcal-setup-$version.exe" \
        installer/windows/handcal.nsi
}

# Downloads what a file of requirements lists, for Windows: download FILE FOLDER
download() {
    "$python" -m pip --disable-pip-version-check --quiet download --no-deps --require-hashes \
        --only-binary=:all: --platform win_amd64 --python-version 3.13 -r "$1" -d "$2"
}

case ${1:-} in
wheel | deb | deb-open3d | windows) wanted=(wheel "$1") ;;
all) wanted=(wheel deb deb-open3d windows) ;;
*) fail "say what to build: wheel, deb, deb-open3d, windows or all" ;;
esac
for one in "${wanted[@]}"; do
    "needs_$one"
done
mkdir -p "$work"
make_environment "$work/venv" installer/requirements-build.lock
for one in $(printf '%s\n' "${wanted[@]}" | awk '!seen[$0]++'); do
    "build_$one"
done
ls -l dist/handcal*
