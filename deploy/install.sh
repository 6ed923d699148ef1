#!/bin/sh
# Installs handeyed from this source tree into /opt/handeyed, as a systemd service. Run it again to update or repair:
# an installed release is kept, settings in /etc/handeyed are never overwritten, stored data are unchanged.
#
#   sudo deploy/install.sh              install or update; restarts the service only when it runs, and after the run in
#                                       progress has ended (--now: aborts it); see deploy/handeyed-release
#   sudo deploy/install.sh --rollback   go back to the release before this one
#   sudo deploy/install.sh --uninstall  remove the program; settings and data stay
set -eu

ROOT=/opt/handeyed
CONFIG=/etc/handeyed
UNIT=/etc/systemd/system/handeyed.service
RULES=/etc/udev/rules.d/99-handeyed.rules
SOURCE=$(cd "$(dirname "$0")/.." && pwd)

say() { printf '%s\n' "$*"; }
fail() { printf 'install.sh: %s\n' "$*" >&2; exit 1; }
have_systemd() { [ -d /run/systemd/system ]; }
systemctl_if() { if have_systemd; then systemctl "$@"; fi; }
running() { have_systemd && systemctl --quiet is-active handeyed; }
switch() { "$SOURCE/deploy/handeyed-release" "$@"; }

uninstall() {
    systemctl_if disable --now handeyed handeyed-backup.timer 2>/dev/null || true
    rm -rf "$ROOT"
    rm -f "$UNIT" /etc/systemd/system/handeyed-backup.* "$RULES" /usr/local/bin/handeyed /usr/local/sbin/handeyed-release
    systemctl_if daemon-reload
    say "handeyed is removed. Settings stay in $CONFIG, data in /var/lib/handeyed; the user 'handeyed' stays with them."
}

fingerprint() { # of everything that makes the release: same source, same name
    cd "$SOURCE"
    find calibration daemon drivers extensions gateways handeyed mock_robot protocols registration hatch_build.py hatch_version.py pyproject.toml deploy/*.lock deploy/rapid \
        deploy/fleet deploy/prometheus deploy/grafana deploy/handeyed.example.toml docs SECURITY.md CHANGELOG.md \
        -type f ! -name '*.pyc' -print0 | LC_ALL=C sort -z | xargs -0 sha256sum | sha256sum | cut -c1-12
}

build() { # $1: folder of the release
    "$SOURCE/deploy/venv.sh" "$1" || fail "nothing was changed"
    touch "$1/complete"
}

settle_in() { # user, folders, settings, unit, devices
    getent passwd handeyed >/dev/null || useradd --system --user-group --home-dir /var/lib/handeyed --shell /usr/sbin/nologin handeyed
    for group in dialout video; do
        if getent group "$group" >/dev/null; then usermod --append --groups "$group" handeyed; fi
    done
    install -d -m 0750 -o root -g handeyed "$CONFIG" "$CONFIG/conf.d"
    install -d -m 0750 -o handeyed -g handeyed /var/lib/handeyed
    install -m 0644 "$SOURCE/deploy/handeyed.example.toml" "$CONFIG/handeyed.example.toml"
    if [ ! -e "$CONFIG/handeyed.toml" ]; then
        install -m 0640 -o root -g handeyed "$SOURCE/deploy/handeyed.example.toml" "$CONFIG/handeyed.toml"
        say "wrote $CONFIG/handeyed.toml: edit it before the first start"
    fi
    install -D -m 0644 "$SOURCE/deploy/handeyed.service" "$UNIT"
    for unit in service timer; do
        install -m 0644 "$SOURCE/deploy/fleet/handeyed-backup.$unit" "/etc/systemd/system/handeyed-backup.$unit"
    done
    install -D -m 0644 "$SOURCE/deploy/99-handeyed.rules" "$RULES"
    install -m 0755 "$SOURCE/deploy/handeyed-release" /usr/local/sbin/handeyed-release
    ln -sfn "$ROOT/current/bin/handeyed" /usr/local/bin/handeyed
    systemctl_if daemon-reload
    if command -v udevadm >/dev/null && [ -d /run/udev ]; then
        udevadm control --reload
        udevadm trigger --subsystem-match=tty --subsystem-match=video4linux
    fi
}

[ "$(id -u)" = 0 ] || fail "run it as root: sudo deploy/install.sh"
mkdir -p "$(dirname "$ROOT")"
exec 9<"$(dirname "$ROOT")" # two at once would each remove what the other one builds
flock --nonblock 9 || fail "another install.sh is at work: wait for it"
case "${1:-}" in
--rollback) shift; switch back "$@"; exit ;;
--uninstall) uninstall; exit ;;
"" | --now) ;;
*) fail "unknown option $1: none, --now, --rollback or --uninstall" ;;
esac

umask 022
release=$(python3 "$SOURCE/hatch_version.py")-$(fingerprint)
mkdir -p "$ROOT/releases"
[ -e "$ROOT/releases/$release/complete" ] || build "$ROOT/releases/$release"
settle_in
switch use "$release" "$@"
running || say "Next: edit $CONFIG/handeyed.toml, run 'runuser -u handeyed -- handeyed check $CONFIG/handeyed.toml', then 'systemctl enable --now handeyed'."
