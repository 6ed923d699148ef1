#!/bin/sh
# Adds packages to a folder that apt installs from, over file:, http: or https:. Older versions in it stay, to go back to.
#
#   deploy/apt-repository.sh FOLDER CODENAME DEB... [--key KEY]
#
# CODENAME: the Debian that the packages are for (bookworm). --key: of gpg's, signs; its public half is in handeyed.gpg.
set -eu

fail() { printf 'apt-repository.sh: %s\n' "$*" >&2; exit 1; }

[ $# -ge 3 ] || fail "give a folder, a codename and packages"
command -v apt-ftparchive >/dev/null || fail "apt-ftparchive is needed: apt-get install apt-utils"
folder=$1 codename=$2 key=
shift 2
umask 022
mkdir -p "$folder/pool/$codename"
while [ $# -gt 0 ]; do
    case "$1" in
    --key)
        key=${2:?name the key}
        shift
        ;;
    *.deb) cp "$1" "$folder/pool/$codename/" ;;
    *) fail "not a package: $1" ;;
    esac
    shift
done

cd "$folder"
for architecture in $(for deb in "pool/$codename"/*.deb; do dpkg-deb --field "$deb" Architecture; done | sort -u); do
    index=dists/$codename/main/binary-$architecture
    mkdir -p "$index"
    apt-ftparchive --arch "$architecture" packages "pool/$codename" >"$index/Packages"
    gzip -9nk --force "$index/Packages"
done
release=dists/$codename/Release
rm -f "$release" "dists/$codename/InRelease" "$release.gpg"
apt-ftparchive -o APT::FTPArchive::Release::Origin=handeyed -o APT::FTPArchive::Release::Label=handeyed \
    -o APT::FTPArchive::Release::Suite="$codename" -o APT::FTPArchive::Release::Codename="$codename" \
    -o APT::FTPArchive::Release::Components=main -o APT::FTPArchive::Release::Architectures="$(dpkg --print-architecture)" \
    release "dists/$codename" >.Release
mv .Release "$release"
if [ -n "$key" ]; then
    gpg --batch --yes --local-user "$key" --clearsign --output "dists/$codename/InRelease" "$release"
    gpg --batch --yes --local-user "$key" --armor --detach-sign --output "$release.gpg" "$release"
    gpg --batch --yes --output handeyed.gpg --export "$key"
fi
