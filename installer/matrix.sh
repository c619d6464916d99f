#!/usr/bin/env bash
# Runs both commands of the README on bare systems of Debian 12 and 13, as root; needs debootstrap:
#   bash installer/matrix.sh [FOLDER [SUITE ...]]
# Makes a minimal system of each suite anew in FOLDER, /var/tmp/handcal-matrix if none is given,
# clones what is committed here into it, with ../shared beside it if there is one, and prints a line
# for each command. Systems and logs stay in FOLDER, 4 GB for each suite.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
folder=${1:-/var/tmp/handcal-matrix}
suites=("${@:2}")
[[ ${#suites[@]} -gt 0 ]] || suites=(bookworm trixie)
failed=0

fail() {
    echo "matrix: $*" >&2
    exit 1
}

[[ $EUID -eq 0 ]] || fail "run it as root: it makes root folders of systems"
command -v debootstrap >/dev/null || fail "debootstrap is missing; run apt-get install debootstrap"

# Makes a bare system with the clone in it, and this computer's way to the network: make SYSTEM SUITE
make() {
    local system=$1 suite=$2
    rm -rf --one-file-system "$system"
    debootstrap --variant=minbase "$suite" "$system"
    cp /etc/resolv.conf "$system/etc"
    # Elsewhere than at home, where the package ca-certificates would replace them.
    cp /etc/ssl/certs/ca-certificates.crt "$system/root"
    git clone -q . "$system/root/handcal"
    [[ ! -d ../shared ]] || mkdir "$system/root/shared"
}

# Runs a command of the clone in a system, whose mounts end with it: inside SYSTEM COMMAND
inside() {
    local network
    local certificates=/root/ca-certificates.crt
    mapfile -t network < <(env | grep -iE '^pip_|_proxy=')
    network+=("PIP_CERT=$certificates" "SSL_CERT_FILE=$certificates")
    # shellcheck disable=SC2016
    unshare --mount bash -c '
        set -e
        for place in proc dev/pts dev/shm; do mount --bind "/$place" "$1/$place"; done
        [[ ! -d $1/root/shared ]] || mount --bind -o ro "$2" "$1/root/shared"
        shift 2
        exec chroot "$@"' - "$1" "$PWD/../shared" "$1" \
        env -i HOME=/root PATH=/usr/sbin:/usr/bin:/sbin:/bin LANG=C.UTF-8 "${network[@]}" \
        bash -c "cd /root/handcal && $2" </dev/null
}

mkdir -p "$folder"
for suite in "${suites[@]}"; do
    system=$folder/$suite
    make "$system" "$suite" >"$system-make.log" 2>&1 || fail "no system: see $system-make.log"
    for script in run test; do
        log=$system-$script.log
        start=$SECONDS
        result=passed
        inside "$system" "bash installer/$script.sh" >"$log" 2>&1 || result="failed ($?), see $log"
        read -r load _ </proc/loadavg
        python=$(inside "$system" "python3 --version")
        echo "$suite, $python, $script.sh: $result; $((SECONDS - start)) s, load $load at the end"
        [[ $result == passed ]] || failed=1
    done
done
exit "$failed"
