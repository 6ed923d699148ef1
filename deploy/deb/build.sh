#!/bin/sh
# Builds dist/handeyed_VERSION_ARCH.deb for the Debian whose python3 this is (PYTHON names another). Needs no root.
# DEB_COMPRESSION="-Zgzip -z1" packs it in seconds, and larger.
#
#   deploy/deb/build.sh [FOLDER]
set -eu

HERE=$(cd "$(dirname "$0")" && pwd)
SOURCE=$(cd "$HERE/../.." && pwd)
DIST=${1:-$SOURCE/dist}
PYTHON=${PYTHON:-python3}

MAINTAINER="${DEBFULLNAME:-handeyed engineers} <${DEBEMAIL:-handeyed@example.org}>"
# dpkg-deb also takes its time stamps from it, so that the same commit gives the same package.
SOURCE_DATE_EPOCH=${SOURCE_DATE_EPOCH:-$(git -C "$SOURCE" log -1 --format=%ct 2>/dev/null || date +%s)}
export SOURCE_DATE_EPOCH

umask 022
HANDEYED_VERSION=$("$PYTHON" "$SOURCE/hatch_version.py")
export HANDEYED_VERSION
# The libraries are those of this Debian's Python: its number makes the versions for two of them different.
# shellcheck source=/dev/null # the system's
debian=$(. /etc/os-release && echo "$VERSION_ID")
version=$("$PYTHON" "$SOURCE/hatch_version.py" --debian)+deb$debian
architecture=$(dpkg --print-architecture)
minor=$("$PYTHON" -c 'import sys; print(sys.version_info.minor)')
root=$(mktemp -d)
trap 'rm -rf "$root"' EXIT
# dpkg owns /opt/handeyed/package, one folder for all versions. Its postinst links the files to a folder of this release,
# which dpkg does not touch: the release before stays whole while the daemon runs from it.
release=/opt/handeyed/releases/$HANDEYED_VERSION
package=$root/opt/handeyed/package

"$SOURCE/deploy/venv.sh" "$package"
echo "$HANDEYED_VERSION" >"$package/share/handeyed/version"

# A virtual environment contains its own path and its interpreter's: both are rewritten for the target machine.
"$package/bin/pip" uninstall --quiet --disable-pip-version-check --yes setuptools pip
find "$package" -name __pycache__ -type d -prune -exec rm -rf {} +
find "$package" -name direct_url.json -delete
find "$package/bin" -mindepth 1 ! -name handeyed -delete
ln -s "/usr/bin/python3.$minor" "$package/bin/python3"
sed -i "1s|.*|#!$release/bin/python3|" "$package/bin/handeyed"
printf 'home = /usr/bin\ninclude-system-site-packages = false\n' >"$package/pyvenv.cfg"
find "$package" -type f ! -path '*/bin/*' -perm /111 ! -name '*.so*' -exec chmod -x {} +
find "$package" -name '*.so*' -type f -exec chmod -x {} +

place() { install -D -m "$1" "$SOURCE/$2" "$root$3"; }
place 0644 deploy/handeyed.service /lib/systemd/system/handeyed.service
place 0644 deploy/fleet/handeyed-backup.service /lib/systemd/system/handeyed-backup.service
place 0644 deploy/fleet/handeyed-backup.timer /lib/systemd/system/handeyed-backup.timer
place 0644 deploy/fleet/handeyed-opcua.service /lib/systemd/system/handeyed-opcua.service
place 0644 deploy/99-handeyed.rules /lib/udev/rules.d/99-handeyed.rules
place 0755 deploy/handeyed-release /usr/sbin/handeyed-release
place 0644 deploy/handeyed.example.toml /usr/share/doc/handeyed/handeyed.example.toml
place 0644 docs/runbook.md /usr/share/doc/handeyed/runbook.md
place 0644 deploy/deb/copyright /usr/share/doc/handeyed/copyright
place 0644 deploy/deb/lintian-overrides /usr/share/lintian/overrides/handeyed
place 0644 CHANGELOG.md /usr/share/doc/handeyed/CHANGELOG.md
printf 'handeyed (%s) unstable; urgency=medium\n\n  * What changed stands in CHANGELOG.md beside this file.\n\n -- %s  %s\n' \
    "$version" "$MAINTAINER" "$(date -R -u -d "@$SOURCE_DATE_EPOCH")" | gzip -9n >"$root/usr/share/doc/handeyed/changelog.gz"
mkdir -p "$root/usr/bin" "$root/usr/share/man/man1"
gzip -9n <"$HERE/handeyed.1" >"$root/usr/share/man/man1/handeyed.1.gz"
ln -s /opt/handeyed/current/bin/handeyed "$root/usr/bin/handeyed"

mkdir "$root/DEBIAN"
size=$(du -sk --exclude=DEBIAN "$root" | cut -f1)
sed -e "s/@VERSION@/$version/" -e "s/@ARCHITECTURE@/$architecture/" -e "s/@SIZE@/$size/" -e "s/@MAINTAINER@/$MAINTAINER/" \
    -e "s/@PYTHON@/python3 (>= 3.$minor), python3 (<< 3.$((minor + 1)))/" "$HERE/control" >"$root/DEBIAN/control"
for script in preinst postinst prerm postrm; do install -m 0755 "$HERE/$script" "$root/DEBIAN/$script"; done
(cd "$root" && find . -type f ! -path './DEBIAN/*' -printf '%P\0' | LC_ALL=C sort -z | xargs -0 md5sum) >"$root/DEBIAN/md5sums"
chmod 0644 "$root/DEBIAN/md5sums" "$root/DEBIAN/control"

mkdir -p "$DIST"
# shellcheck disable=SC2086 # several options
dpkg-deb --root-owner-group ${DEB_COMPRESSION:--Zxz -z3} --build "$root" "$DIST/handeyed_${version}_${architecture}.deb"
