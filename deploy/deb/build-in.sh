#!/bin/sh
# Builds the package for another Debian than this one, in a fresh root of it. Run as root; takes mmdebstrap and
# systemd-nspawn.
#
#   deploy/deb/build-in.sh SUITE [FOLDER]       SUITE: trixie
set -eu

SUITE=${1:?name the Debian: trixie}
SOURCE=$(cd "$(dirname "$0")/../.." && pwd)
DIST=${2:-$SOURCE/dist}

HANDEYED_VERSION=$(python3 "$SOURCE/hatch_version.py")
SOURCE_DATE_EPOCH=${SOURCE_DATE_EPOCH:-$(git -C "$SOURCE" log -1 --format=%ct 2>/dev/null || date +%s)}
mkdir -p "$DIST"
DIST=$(cd "$DIST" && pwd)
root=$(mktemp -d)
trap 'rm -rf "$root"' EXIT
mmdebstrap --quiet --variant=minbase --include=python3,python3-venv,ca-certificates "$SUITE" "$root"
# The index of packages and its authority are those of this machine.
systemd-nspawn --quiet --register=no --keep-unit --directory="$root" --bind-ro="$SOURCE:/source" --bind="$DIST:/out" \
    --bind-ro=/etc/ssl/certs --setenv=PIP_CERT=/etc/ssl/certs/ca-certificates.crt \
    --setenv=PIP_INDEX_URL="${PIP_INDEX_URL:-https://pypi.org/simple}" --setenv=HANDEYED_VERSION="$HANDEYED_VERSION" \
    --setenv=SOURCE_DATE_EPOCH="$SOURCE_DATE_EPOCH" --setenv=DEB_COMPRESSION="${DEB_COMPRESSION:--Zxz -z3}" \
    /source/deploy/deb/build.sh /out
