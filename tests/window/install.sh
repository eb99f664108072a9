#!/usr/bin/env bash
# Installs a real Blender with a window system in a new Debian folder (a chroot).
#   install.sh SUITE FOLDER      trixie: Blender 4.3, Python 3.13 · sid: Blender 5.2, Python 3.14
# Takes three minutes and 2.2 GB; does nothing if it is installed already. Needs root, debootstrap and a Debian mirror.
set -euo pipefail
suite=${1:?suite} folder=${2:?folder}
mirror=${DEBIAN_MIRROR:-http://deb.debian.org/debian}
done_mark=$folder/.installed

if [ -e "$done_mark" ] || { [ -x "$folder/usr/bin/blender" ] && [ -x "$folder/usr/bin/Xvfb" ]; }; then exit 0; fi
[ "$(id -u)" = 0 ] || { echo "root is needed to make a chroot" >&2; exit 1; }
command -v debootstrap >/dev/null || { apt-get update -qq && apt-get install -y -qq --no-install-recommends debootstrap; }

echo "installing Blender from Debian $suite in $folder (three minutes, 2.2 GB)"
[ -x "$folder/usr/bin/apt-get" ] || debootstrap --variant=minbase "$suite" "$folder" "$mirror" >/dev/null
# Services must not start in the chroot.
printf '#!/bin/sh\nexit 101\n' > "$folder/usr/sbin/policy-rc.d"
chmod +x "$folder/usr/sbin/policy-rc.d"
cp /etc/resolv.conf "$folder/etc/resolv.conf"
# The index of sid on a mirror can be past its own validity date.
echo 'Acquire::Check-Valid-Until "false";' > "$folder/etc/apt/apt.conf.d/99window-tests"

mount -t proc proc "$folder/proc"
trap 'umount "$folder/proc"' EXIT
# Debian's Blender does not bring NumPy. Blender 5's extensions need cattrs and zstandard too.
packages="blender xvfb xdotool scrot libgl1-mesa-dri libegl1 libgl1 xfonts-base ca-certificates
          python3-numpy python3-requests libopenblas0"
if [ "$suite" = sid ]; then packages="$packages python3-cattr python3-zstandard"; fi
chroot "$folder" apt-get update -qq
# shellcheck disable=SC2086
DEBIAN_FRONTEND=noninteractive chroot "$folder" apt-get install -y -qq --no-install-recommends $packages >/dev/null
chroot "$folder" apt-get clean
mkdir -p -m 1777 "$folder/tmp/.X11-unix"
chroot "$folder" blender --version | head -n 1
touch "$done_mark"
