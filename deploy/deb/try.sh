#!/bin/sh
# Installs the package in a fresh Debian (debootstrap), checks version, settings and a calibration against
# the mock cell as the service's user, removes and purges it, and reports what remains. Run as root.
#
#   deploy/deb/try.sh dist/handeyed_*.deb [CHROOT]     CHROOT: a Debian made before, else one is made and deleted
set -eu

PACKAGE=${1:?name the package}
CHROOT=${2:-}
MIRROR=${MIRROR:-http://deb.debian.org/debian}

fail() { printf 'try.sh: %s\n' "$*" >&2; exit 1; }
inside() { chroot "$CHROOT" env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin LC_ALL=C.UTF-8 DEBIAN_FRONTEND=noninteractive "$@"; }

[ "$(id -u)" = 0 ] || fail "run it as root"
if [ -z "$CHROOT" ]; then
    CHROOT=$(mktemp -d)
    chmod 0755 "$CHROOT" # the service's user has to get in
    trap 'umount "$CHROOT/proc" 2>/dev/null || true; rm -rf "$CHROOT"' EXIT
    debootstrap --variant=minbase --include=python3,adduser,libstdc++6,systemd,udev bookworm "$CHROOT" "$MIRROR"
else
    trap 'umount "$CHROOT/proc" 2>/dev/null || true' EXIT
fi
mountpoint -q "$CHROOT/proc" || mount -t proc proc "$CHROOT/proc"
cp "$PACKAGE" "$CHROOT/tmp/handeyed.deb"

echo "== install"
inside dpkg --install /tmp/handeyed.deb
inside dpkg --verify handeyed | grep -v /etc/handeyed && fail "a file is not as packaged"
inside handeyed version
inside runuser -u handeyed -- handeyed check --config-only /etc/handeyed/handeyed.toml
inside systemd-analyze verify --man=no /lib/systemd/system/handeyed.service
inside runuser -u handeyed -- sh -c 'cd /tmp && HOME=/tmp handeyed demo' || fail "the demo does not run"

echo "== a backup is restored by the Python that is deployed"
settings=/etc/handeyed/handeyed.toml
inside runuser -u handeyed -- handeyed keys add $settings Ann
inside runuser -u handeyed -- handeyed backup $settings --out /tmp/handeyed.tar
[ "$(stat -c %a "$CHROOT/tmp/handeyed.tar")" = 600 ] || fail "others may read the backup"
find "$CHROOT/var/lib/handeyed" -mindepth 1 -delete
inside runuser -u handeyed -- handeyed restore /tmp/handeyed.tar $settings
inside runuser -u handeyed -- handeyed audit verify $settings
inside runuser -u handeyed -- handeyed keys list $settings | grep Ann || fail "the key is not there"
find "$CHROOT/var/lib/handeyed" -mindepth 1 -delete

echo "== install over itself after an administrator has deleted the settings"
mv "$CHROOT$settings" "$CHROOT/tmp/settings"
inside dpkg --install /tmp/handeyed.deb
mv "$CHROOT/tmp/settings" "$CHROOT$settings"

echo "== install again over itself: the settings a plant has edited stay"
echo '# edited by the plant' >>"$CHROOT/etc/handeyed/handeyed.toml"
inside dpkg --install /tmp/handeyed.deb
grep -q 'edited by the plant' "$CHROOT/etc/handeyed/handeyed.toml" || fail "the edited settings are gone"

echo "== remove: settings and data stay"
touch "$CHROOT/var/lib/handeyed/measured"
inside dpkg --remove handeyed
[ ! -e "$CHROOT/opt/handeyed" ] || fail "/opt/handeyed is left: $(find "$CHROOT/opt/handeyed" | head -3)"
[ -e "$CHROOT/etc/handeyed/handeyed.toml" ] || fail "the settings are gone"

echo "== purge: data stay"
inside dpkg --purge handeyed
[ ! -e "$CHROOT/etc/handeyed" ] || fail "/etc/handeyed is left"
[ -e "$CHROOT/var/lib/handeyed/measured" ] || fail "what was measured is gone"
rm -f "$CHROOT/var/lib/handeyed/measured"
echo "the package installs, runs, updates, and leaves nothing but what was measured"
