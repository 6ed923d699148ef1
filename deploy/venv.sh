#!/bin/sh
# Builds one release of handeyed, a virtual environment pinned by deploy/*.lock, into a folder:
#
#   deploy/venv.sh FOLDER
#
# install.sh builds in place, deb/build.sh in a staging folder. PYTHON names another interpreter than python3. Its version
# is that of the commit; HANDEYED_VERSION says another, where there is no git.
set -eu

PYTHON=${PYTHON:-python3}
SOURCE=$(cd "$(dirname "$0")/.." && pwd)
FOLDER=${1:?name the folder of the release}

say() { printf '%s\n' "$*"; }
fail() { printf 'venv.sh: %s\n' "$*" >&2; exit 1; }

"$PYTHON" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null || fail "python3 3.11 or newer is needed"
"$PYTHON" -c 'import venv, ensurepip' 2>/dev/null || fail "python3-venv is needed: apt install python3-venv"
rm -rf "$FOLDER"
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

say "building (pinned by deploy/*.lock) ..."
"$PYTHON" -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check --require-hashes -r "$SOURCE/deploy/build.lock"
HANDEYED_VERSION=$("$PYTHON" "$SOURCE/hatch_version.py") # the copy below has no git
export HANDEYED_VERSION
mkdir -p "$work/source/deploy" "$work/source/docs"
(cd "$SOURCE" && cp -R calibration daemon drivers extensions gateways handeyed mock_robot protocols registration hatch_build.py hatch_version.py pyproject.toml CHANGELOG.md README.md LICENSE "$work/source/")
cp -R "$SOURCE/deploy/rapid" "$work/source/deploy/"
cp "$SOURCE"/docs/*.schema.json "$work/source/docs/"
"$work/venv/bin/pip" wheel --quiet --disable-pip-version-check --no-deps --no-build-isolation --wheel-dir "$work" "$work/source"

say "installing into $FOLDER ..."
"$PYTHON" -m venv "$FOLDER"
"$FOLDER/bin/pip" install --quiet --disable-pip-version-check --require-hashes -r "$SOURCE/deploy/requirements.lock"
"$FOLDER/bin/pip" install --quiet --disable-pip-version-check --no-deps "$work"/handeyed-*.whl
# Libraries of cameras (docs/cameras.md) stand outside the releases, and behind what the locks pin.
echo /opt/handeyed/extras >"$(echo "$FOLDER"/lib/python3.*/site-packages)/handeyed-extras.pth"
share="$FOLDER/share/handeyed" # what a plant reads, loads into the controller, PLC and MES, and gives to its Prometheus
mkdir -p "$share/docs" "$share/deploy"
(cd "$SOURCE/docs" && cp -R ./*.md ./*.svg ./*.csv ./*.json ./*.ipynb page decisions start use why "$share/docs/")
(cd "$SOURCE/deploy" && cp -R handeyed.example.toml fleet prometheus grafana rapid "$share/deploy/")
cp "$SOURCE/SECURITY.md" "$SOURCE/CHANGELOG.md" "$share/"
"$FOLDER/bin/handeyed" version >/dev/null || fail "the new release does not run"
