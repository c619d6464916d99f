#!/usr/bin/env bash
# Installs the Debian package in a bare system and calibrates a simulated wearer in it:
#   bash installer/linux/smoke.sh FOLDER PACKAGE      as root
# FOLDER holds a system made by `debootstrap --variant=minbase`, with /proc and /dev mounted and a
# network. With DISPLAY set, the window is shown there; otherwise Qt draws it in memory.
set -euo pipefail
folder=$1 package=$2
name=${package##*/}
name=${name%%_*}
cp "$package" "$folder/root/"
screen=QT_QPA_PLATFORM=offscreen
[[ -n ${DISPLAY:-} ]] && screen=DISPLAY=$DISPLAY
inside() {
    chroot "$folder" env -i HOME=/root LANG=C.UTF-8 DEBIAN_FRONTEND=noninteractive \
        PATH=/usr/sbin:/usr/bin:/sbin:/bin OMP_NUM_THREADS=1 \
        "$screen" "$@"
}
inside apt-get update -qq
inside apt-get install -y -qq --no-install-recommends "/root/${package##*/}"
inside handcal doctor
rm -rf "$folder/root/demo"
log=$(mktemp)
time inside handcal-gui --source simulator --autopilot --seed 1 --output /root/demo \
    --preferences /root/demo/preferences.json 2> >(tee "$log" >&2)
if grep -q 'Traceback\|No such file' "$log"; then
    echo "the program complained" >&2
    exit 1
fi
find "$folder/root/demo" -name '*.pdf' -o -name '*.svg' -o -name results.json | sort
test -n "$(find "$folder/root/demo" -name '*.pdf')"
if [[ $name == handcal-open3d ]]; then
    session=$(echo "$folder"/root/demo/session-*[0-9])
    inside handcal inspect "${session#"$folder"}" --picture /root/view.png
fi
inside apt-get remove -y -qq "$name"
test ! -e "$folder/opt/handcal" -a ! -e "$folder/usr/bin/handcal"
echo "smoke test passed"
