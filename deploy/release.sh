#!/bin/sh
# Makes a release of this commit: the package for this Debian, the wheel, a wheelhouse for machines without internet, the
# bill of materials, checksums, and a folder that apt installs and updates from.
#
#   deploy/release.sh FOLDER [--key KEY]
#
# FOLDER/VERSION/ gets the files, FOLDER/apt/ the package beside those of earlier releases. --key: of gpg's, signs both.
# PYTHON names another interpreter than /usr/bin/python3.
set -eu

PYTHON=${PYTHON:-/usr/bin/python3}
SOURCE=$(cd "$(dirname "$0")/.." && pwd)
FOLDER=${1:?name the folder of the releases}
KEY=
if [ "${2:-}" = --key ]; then KEY=${3:?name the key}; fi

say() { printf '%s\n' "$*"; }
fail() { printf 'release.sh: %s\n' "$*" >&2; exit 1; }

HANDEYED_VERSION=$("$PYTHON" "$SOURCE/hatch_version.py")
export HANDEYED_VERSION
case "$HANDEYED_VERSION" in
*.dirty | *unknown) fail "$HANDEYED_VERSION: commit first, a release is of a commit" ;;
esac
base=${HANDEYED_VERSION%%.dev*}
grep -q "^## $base" "$SOURCE/CHANGELOG.md" || fail "CHANGELOG.md has no section $base"
SOURCE_DATE_EPOCH=$(git -C "$SOURCE" log -1 --format=%ct)
export SOURCE_DATE_EPOCH
command -v apt-ftparchive >/dev/null || fail "apt-ftparchive is needed: apt-get install apt-utils"

mkdir -p "$FOLDER"
out=$(cd "$FOLDER" && pwd)/$HANDEYED_VERSION
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
rm -rf "$out"
mkdir -p "$out"

say "the documentation ..."
"$PYTHON" -m venv "$work/docs"
"$work/docs/bin/pip" --quiet --disable-pip-version-check install --require-hashes -r "$SOURCE/deploy/requirements.lock"
"$work/docs/bin/pip" --quiet --disable-pip-version-check install 'mkdocs>=1.6,<2' 'mkdocs-material>=9.6,<10'
(cd "$SOURCE" && NO_MKDOCS_2_WARNING=1 "$work/docs/bin/mkdocs" build --quiet) # daemon/site: package and wheel take it

say "the package ..."
PYTHON=$PYTHON "$SOURCE/deploy/deb/build.sh" "$out" >/dev/null

say "the wheel, and the wheelhouse ..."
"$PYTHON" -m venv "$work/venv"
pip() { "$work/venv/bin/pip" --quiet --disable-pip-version-check "$@"; }
pip install --require-hashes -r "$SOURCE/deploy/build.lock"
pip wheel --no-deps --no-build-isolation --wheel-dir "$out" "$SOURCE"
house=handeyed-$HANDEYED_VERSION-wheelhouse
mkdir "$work/$house"
pip download --require-hashes --only-binary :all: --dest "$work/$house" -r "$SOURCE/deploy/requirements.lock"
cp "$out"/handeyed-*.whl "$work/$house/"
cat >"$work/$house/README.txt" <<TEXT
handeyed $HANDEYED_VERSION and its libraries, for $("$PYTHON" --version) on $(uname -m), without a package index:

  python3 -m venv /opt/handeyed-venv
  /opt/handeyed-venv/bin/pip install --no-index --find-links . handeyed==$HANDEYED_VERSION
TEXT
tar -C "$work" --owner=0 --group=0 --sort=name --mtime="@$SOURCE_DATE_EPOCH" -cf "$out/$house.tar" "$house"

say "the bill of materials ..."
"$PYTHON" -m venv "$work/sbom"
"$work/sbom/bin/pip" --quiet --disable-pip-version-check install 'cyclonedx-bom>=7,<8'
sed "s/^dynamic = .*/version = \"$HANDEYED_VERSION\"/" "$SOURCE/pyproject.toml" >"$work/pyproject.toml"
"$work/sbom/bin/cyclonedx-py" requirements --pyproject "$work/pyproject.toml" --output-reproducible \
    --output-file "$out/handeyed-$HANDEYED_VERSION.cdx.json" "$SOURCE/deploy/requirements.lock" 2>/dev/null

sed -n "/^## $base/,/^## /p" "$SOURCE/CHANGELOG.md" | sed '$ { /^## /d }' >"$out/CHANGES.md"
(cd "$out" && sha256sum -- * >"$work/SHA256SUMS" && mv "$work/SHA256SUMS" SHA256SUMS)
if [ -n "$KEY" ]; then gpg --batch --yes --local-user "$KEY" --armor --detach-sign "$out/SHA256SUMS"; fi

say "the folder for apt ..."
# shellcheck source=/dev/null # the system's
codename=$(. /etc/os-release && echo "$VERSION_CODENAME")
"$SOURCE/deploy/apt-repository.sh" "$FOLDER/apt" "$codename" "$out"/*.deb ${KEY:+--key "$KEY"}

say "apt takes this package from it ..."
apt=$(cd "$FOLDER/apt" && pwd)
trust=trusted=yes
if [ -n "$KEY" ]; then trust=signed-by=$apt/handeyed.gpg; fi
mkdir -p "$work/apt/state/lists/partial" "$work/apt/cache/archives/partial"
echo "deb [$trust] file:$apt $codename main" >"$work/apt/sources.list"
from_it() {
    apt-get -qq -o Dir::Etc::SourceList="$work/apt/sources.list" -o Dir::Etc::SourceParts=- -o Dir::State="$work/apt/state" \
        -o Dir::State::Status=/dev/null -o Dir::Cache="$work/apt/cache" -o APT::Sandbox::User= "$@"
}
from_it update
(cd "$work/apt" && from_it download handeyed)
cmp "$work/apt"/handeyed_*.deb "$out"/handeyed_*.deb || fail "apt takes another package from $apt than the one made here"
say "$out"
