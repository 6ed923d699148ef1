"""The story of docs/runbook.md under a live systemd, command by command.

`shown` runs a command that the runbook prints, with its placeholders filled; tests/deploy/test_runbook.py holds the two
to each other. What the story does besides goes through `machine.run`.
"""

import json
import os
import re
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from tests.systemd.machine import ADDRESS, Failed, Machine, Ran
from tests.systemd.packages import repack, version_of

SETTINGS = "/etc/handeyed/handeyed.toml"
HTTP = "http://127.0.0.1:8372"
SIGNER = "releases@example.org"
AUTHORIZATION = "-H @/run/handeyed/authorization"

MOCK = """set -e
cp -al "$(readlink -f /opt/handeyed/current)" /opt/mock
systemd-run --quiet --unit=mock --property=DynamicUser=yes --property=StateDirectory=mock \\
    --property=WorkingDirectory=/var/lib/mock --setenv=PYTHONSAFEPATH=1 /opt/mock/bin/python3 \\
    -m handeyed.mock_robot run --seed 7 --time-scale 10 --ready-file /var/lib/mock/ready.json
while ! [ -e /var/lib/mock/ready.json ]; do sleep 0.2; done
/opt/mock/bin/python3 - <<'END' >/root/mock.toml
import json, pathlib
from handeyed.daemon.cli.demo_run.scenario import settings_text
text = settings_text(json.loads(pathlib.Path("/var/lib/mock/ready.json").read_text()), 8372)
print(text.replace('folder = "store"', 'folder = "/var/lib/handeyed"'))
END
"""
"""A cell to work with, and its settings as the plant edits them, from a copy of the release that no update touches."""

GATEWAY = """[[cell]]
name = "cell7"
url = "https://127.0.0.1:8372"
key_file = "/run/credentials/handeyed-opcua.service/cell7.key"
ca_file = "authority.pem"
"""

CREDENTIAL = """[Service]
LoadCredential=cell7.key:/etc/handeyed-opcua/cell7.key
"""

OPC_UA_CLIENT = """import asyncio, pathlib, shutil, sys
from asyncua import Client, ua
from asyncua.crypto.cert_gen import setup_self_signed_certificate
from asyncua.crypto.security_policies import SecurityPolicyBasic256Sha256
from cryptography.x509.oid import ExtendedKeyUsageOID

async def main():
    state, name = pathlib.Path("/var/lib/handeyed-opcua/pki"), "urn:test:client"
    own, private = pathlib.Path("/root/mes.der"), pathlib.Path("/root/mes-key.pem")
    use = [ExtendedKeyUsageOID.CLIENT_AUTH]
    await setup_self_signed_certificate(private, own, name, "localhost", use, {"commonName": "mes"})
    shutil.copy(own, state / "trusted/mes.der")
    (state / "trusted/mes.der").chmod(0o644)
    client = Client("opc.tcp://127.0.0.1:4840/", timeout=30)
    client.application_uri = name
    policy = SecurityPolicyBasic256Sha256
    await client.set_security(policy, own, private, server_certificate=state / "own/gateway.der")
    client.set_user("mes")
    client.set_password(sys.argv[1])
    async with client:
        cells = await client.get_namespace_index("urn:handeyed:cells")
        for what in ("Version", "State", "CalibrationId"):
            print(what, await client.get_node(ua.NodeId(f"cell7.Cell.{what}", cells)).read_value())

asyncio.run(main())
"""


@dataclass
class Story:
    """The machine, the package that was built, and what later steps need of earlier ones."""

    machine: Machine
    deb: Path
    folder: Path
    verbose: bool = False
    key: str = ""

    def shown(self, command: str, /, check: bool = True, **filled: str) -> Ran:
        """Run a command of the runbook; `filled` has its placeholders, words in capitals."""
        for word, text in filled.items():
            assert word in command, f"{word} is not in {command}"
            command = command.replace(word, text)
        ran = self.machine.run(f"cd /root && {command}", check=check)
        if self.verbose:
            print(f"# {command}\n{ran.text}", flush=True)
        return ran

    def started(self, command: str, /) -> "subprocess.Popen[str]":
        """Start a command of the runbook, and go on beside it."""
        return self.machine.start(f"cd /root && {command}")

    def offer(self, deb: Path) -> None:
        """Put a package into the folder of releases, signed."""
        script = Path(__file__).resolve().parents[2] / "deploy" / "apt-repository.sh"
        signs = {**os.environ, "GNUPGHOME": str(self.folder / "gnupg")}
        if not (self.folder / "gnupg").exists():
            (self.folder / "gnupg").mkdir(mode=0o700)
            make = ["gpg", "--batch", "--quiet", "--passphrase", "", "--quick-generate-key", SIGNER, "ed25519", "sign"]
            subprocess.run(make, env=signs, check=True, capture_output=True)
        folder = self.machine.root / "srv/handeyed/apt"
        command = [str(script), str(folder), "bookworm", str(deb), "--key", SIGNER]
        subprocess.run(command, env=signs, check=True, capture_output=True)

    def place(self, deb: Path) -> str:
        """Put a package where the runbook's commands find it; returns the word for VERSION."""
        (self.machine.root / "root" / deb.name).write_bytes(deb.read_bytes())
        return deb.name.removeprefix("handeyed_").removesuffix(".deb").rpartition("_")[0]

    def settings(self, *changes: tuple[str, str]) -> None:
        """Write the mock's settings, with texts replaced."""
        text = (self.machine.root / "root/mock.toml").read_text()
        for before, after in changes:
            assert before in text, before
            text = text.replace(before, after)
        (self.machine.root / SETTINGS[1:]).write_text(text)

    def answers(self) -> None:
        self.machine.until(f"handeyed health {SETTINGS}", ["answers at"])


def expect(ran: Ran, *texts: str) -> Ran:
    """Raises Failed unless the command printed all these texts."""
    for text in texts:
        if text not in ran.text:
            raise Failed(f"$ {ran.command}\n{ran.text}\nit does not have {text!r}")
    return ran


def install(story: Story) -> None:
    """From a signed folder of releases; nothing is asked, and what comes next is said; user and folders are there."""
    machine = story.machine
    story.offer(story.deb)
    story.shown("install -m 644 /srv/handeyed/apt/handeyed.gpg /usr/share/keyrings/handeyed.gpg")
    story.shown(
        "echo 'deb [signed-by=/usr/share/keyrings/handeyed.gpg] file:/srv/handeyed/apt bookworm main'"
        " >/etc/apt/sources.list.d/handeyed.list"
    )
    story.shown("apt-get update")
    expect(story.shown("apt-get install handeyed"), "systemctl enable --now handeyed")
    expect(machine.run("stat -c '%a %U %G' /etc/handeyed/handeyed.toml /var/lib/handeyed"),
           "640 root handeyed", "750 handeyed handeyed")  # fmt: skip
    expect(story.shown("handeyed --version"), "handeyed 0.")
    expect(story.shown("handeyed-release"), "current")
    if machine.run("dpkg --verify handeyed").text:
        raise Failed("a file is not as packaged")


def connect(story: Story) -> None:
    """The settings are edited and checked; the service is started, answers, and says so in systemctl status."""
    story.machine.run(MOCK)
    story.settings()
    expect(story.shown("runuser -u handeyed -- handeyed check /etc/handeyed/handeyed.toml"),
           "ok    settings", "ok    robot", "ok    camera")  # fmt: skip
    story.shown("systemctl enable --now handeyed")
    expect(story.shown("systemctl status handeyed"), "active (running)", 'Status: "up, no run in progress"')
    expect(story.shown("handeyed health /etc/handeyed/handeyed.toml"), f"answers at {HTTP}")
    expect(story.shown("runuser -u handeyed -- handeyed check /etc/handeyed/handeyed.toml"), "with this file")


def calibrate(story: Story) -> None:
    """Nobody outside the group moves the arm; root calibrates by the command and by curl."""
    machine = story.machine
    refused = machine.run(f"curl -s -X POST {HTTP}/calibrate", user="nobody")
    expect(refused, "role-too-low", "-H @/run/handeyed/authorization")
    if machine.run("cat /run/handeyed/authorization", check=False, user="nobody").status == 0:
        raise Failed("nobody reads the service's key")
    expect(story.shown("handeyed calibrate --count 8"), "accepted")
    curl = f"curl -s {AUTHORIZATION} -H 'Accept: text/plain' -X POST '{HTTP}/calibrate?wait=120'"
    expect(machine.run(curl), "accepted")
    verify = (
        "curl -H @/run/handeyed/authorization -H 'Accept: text/plain' -X POST 'http://127.0.0.1:8372/verify?wait=120'"
    )
    expect(story.shown(verify), "finished")


def look(story: Story) -> None:
    """The commands of every day."""
    expect(
        story.shown("curl -H @/run/handeyed/authorization -H 'Accept: text/plain' http://127.0.0.1:8372/ready"), "ready"
    )
    expect(story.shown("curl -H @/run/handeyed/authorization -H 'Accept: text/plain'"
                       " http://127.0.0.1:8372/calibrations/current"), "accuracy")  # fmt: skip
    story.shown("curl -H @/run/handeyed/authorization -H 'Accept: text/plain' http://127.0.0.1:8372/drift")
    heard = story.machine.run(f"timeout 2 curl -s {AUTHORIZATION} -N {HTTP}/events", check=False)
    expect(heard, ":")


def kill(story: Story) -> None:
    """A killed daemon is back by itself."""
    pid = story.machine.run("systemctl show --property=MainPID --value handeyed").text.strip()
    story.machine.run(f"kill -9 {pid}")
    story.machine.until("systemctl show --property=NRestarts --value handeyed", ["1"])
    story.answers()


def hang(story: Story) -> None:
    """A daemon that hangs is ended by the watchdog, and back by itself."""
    pid = story.machine.run("systemctl show --property=MainPID --value handeyed").text.strip()
    story.machine.run(f"kill -STOP {pid}")
    story.machine.until("journalctl --unit=handeyed --no-pager", ["Watchdog timeout"], limit_s=90)
    story.machine.until(f"curl -s {HTTP}/health", ["alive"], limit_s=60)
    expect(story.machine.run(f"curl -s {HTTP}/ready"), "by itself, last after watchdog")
    expect(story.machine.run(f"curl -s {HTTP}/metrics"), 'handeyed_service_restarts_total{cause="watchdog"} 1')
    expect(story.shown("journalctl -u handeyed -p warning"), "Watchdog timeout")
    expect(story.machine.run("journalctl --unit=handeyed --no-pager"), "Fatal Python error: Aborted")


def wrong_settings(story: Story) -> None:
    """The sentence stands in status and in the warnings of the journal; it is not retried; plain start after repair."""
    machine = story.machine
    story.settings(("speed_mm_s =", "speed_mms ="))
    machine.run("systemctl restart handeyed", check=False)
    sentence = "robot.speed_mms: unknown key: did you mean 'speed_mm_s'?"
    status = story.shown("systemctl status handeyed", check=False)
    expect(status, "failed", sentence, "status=2")
    expect(story.shown("journalctl -u handeyed -p warning"), sentence)
    restarts = machine.run("systemctl show --property=NRestarts --value handeyed").text
    time.sleep(7)  # longer than RestartSec=: there is no sign of what does not happen
    if machine.run("systemctl show --property=NRestarts --value handeyed").text != restarts:
        raise Failed("wrong settings are tried again")
    story.settings()
    story.shown("systemctl start handeyed")
    story.answers()


def restarts(story: Story) -> None:
    """The sixth restart in a row leaves it up."""
    for _ in range(6):
        story.shown("systemctl restart handeyed")
    story.answers()


def late_address(story: Story) -> None:
    """A PLC address that the PC gets later: up with a warning, and reached once it is here."""
    machine = story.machine
    story.settings(("[server]", f'[plc]\nhost = "{ADDRESS}"\nport = 1502\n\n[server]'))
    story.shown("systemctl restart handeyed")
    warning = f"this PC does not have the address {ADDRESS} of [plc] host yet"
    machine.until("systemctl status --no-pager handeyed", ["active (running)", warning])
    machine.run(f"ip address add {ADDRESS}/24 dev lo")
    connects = f"import socket; socket.create_connection(({ADDRESS!r}, 1502), 5)"
    machine.run(f'/opt/mock/bin/python3 -c "{connects}"')
    machine.until("systemctl status --no-pager handeyed", ['Status: "up, no run in progress"'])


def reload(story: Story) -> None:
    """What can be taken over while it runs is, without a restart; the rest is named in status and in the journal."""
    machine = story.machine
    pid = machine.run("systemctl show --property=MainPID --value handeyed").text
    story.settings(("tolerance_mm = 1.0", "tolerance_mm = 0.9"))
    story.shown("systemctl reload handeyed")
    asked = f"curl -s {AUTHORIZATION} {HTTP}/settings"
    machine.until(asked, ['"tolerance_mm":0.9'])
    refused = f"import socket; socket.create_connection(({ADDRESS!r}, 1502), 5)"
    expect(machine.run(f'/opt/mock/bin/python3 -c "{refused}"', check=False), "ConnectionRefusedError")  # [plc] is gone
    story.settings(("speed_mm_s = 250.0", "speed_mm_s = 200.0"))
    story.shown("systemctl reload handeyed")
    machine.until("systemctl status --no-pager handeyed", ["need a restart: robot.speed_mm_s"])
    expect(story.shown("journalctl -u handeyed -p warning"), "these settings need a restart: robot.speed_mm_s")
    if machine.run("systemctl show --property=MainPID --value handeyed").text != pid:
        raise Failed("the reload has restarted it")


def fragment(story: Story) -> None:
    """A file in conf.d is over the settings, named by the check, and taken by a reload."""
    story.settings()
    story.shown("systemctl restart handeyed")
    story.shown("printf '[report]\\nplant = \"PLANT\"\\n' >/etc/handeyed/conf.d/10-plant.toml", PLANT="Plant 3")
    checked = story.shown("runuser -u handeyed -- handeyed check --config-only /etc/handeyed/handeyed.toml")
    expect(checked, "/etc/handeyed/conf.d/10-plant.toml gives report.plant")
    story.shown("systemctl reload handeyed")
    story.machine.until(f"curl -s {AUTHORIZATION} {HTTP}/settings", ['"plant":"Plant 3"'])


def lock_up(story: Story) -> None:
    """Keys and a certificate as the runbook prints them; check, health and commands go on without variables."""
    added = story.shown("runuser -u handeyed -- handeyed keys add /etc/handeyed/handeyed.toml MES --role operator")
    (story.key,) = re.findall(r"hek_[0-9a-f]{8}_[0-9a-f]{64}", added.text)
    story.shown("install -d -o handeyed -g handeyed -m 750 /etc/handeyed/tls")
    made = story.shown("runuser -u handeyed -- handeyed tls init --host NAME --out /etc/handeyed/tls", NAME="cell-7")
    printed = made.text.partition("[server]\n")[2].partition("\n\n")[0]
    story.settings(("[server]", f"[server]\n{printed}"))
    story.shown("systemctl restart handeyed")
    story.machine.run("grep -q cell-7 /etc/hosts || echo '127.0.1.1 cell-7' >>/etc/hosts")
    over_tls = 'curl --cacert /etc/handeyed/tls/authority.pem -H "Authorization: Bearer KEY" https://NAME:8372/runs'
    expect(story.shown(over_tls, NAME="cell-7", KEY=story.key), '"runs"')
    without = "curl -s --cacert /etc/handeyed/tls/authority.pem https://127.0.0.1:8372/runs"
    expect(story.machine.run(without), "key-missing")
    expect(story.shown("handeyed health /etc/handeyed/handeyed.toml"), "answers at https://")
    checked = story.shown("runuser -u handeyed -- handeyed check /etc/handeyed/handeyed.toml")
    expect(checked, "with this file", "ready to calibrate")
    expect(story.machine.run("handeyed calibrate --count 3"), "accepted")
    expect(story.shown("runuser -u handeyed -- handeyed keys list /etc/handeyed/handeyed.toml"), "MES")
    expect(story.shown("runuser -u handeyed -- handeyed audit verify /etc/handeyed/handeyed.toml"), "whole")


def show_over_opc_ua(story: Story) -> None:
    """The gateway's unit, by a user of its own, reads a key that is root's, and shows the cell to whom it trusts."""
    machine = story.machine
    extras, own = machine.root / "opt/handeyed/extras", story.folder / "pip"  # Debian's python3 need not have pip
    subprocess.run([sys.executable, "-m", "venv", str(own)], check=True)
    python = machine.run("/opt/mock/bin/python3 --version").text.split()[1].rpartition(".")[0]
    install = [str(own / "bin/pip"), "install", "--quiet", "--no-warn-conflicts", "--target", str(extras)]
    subprocess.run([*install, "--only-binary=:all:", f"--python-version={python}", "asyncua>=2.1,<3"], check=True)
    added = machine.run(f"runuser -u handeyed -- handeyed keys add {SETTINGS} gateway --role viewer")
    (key,) = re.findall(r"hek_[0-9a-f]{8}_[0-9a-f]{64}", added.text)
    for path, text in (
        ("etc/handeyed-opcua/gateway.toml", GATEWAY),
        ("etc/handeyed-opcua/cell7.key", key),
        ("etc/systemd/system/handeyed-opcua.service.d/key.conf", CREDENTIAL),
        ("root/mes.py", OPC_UA_CLIENT),
    ):
        (machine.root / path).parent.mkdir(parents=True, exist_ok=True)
        (machine.root / path).write_text(text)
    machine.run("chmod 600 /etc/handeyed-opcua/cell7.key")
    machine.run("install -m 644 /etc/handeyed/tls/authority.pem /etc/handeyed-opcua/")
    machine.run("systemctl daemon-reload && systemctl enable --now handeyed-opcua")
    ask = f"curl -s --cacert /etc/handeyed/tls/authority.pem {AUTHORIZATION} https://127.0.0.1:8372"
    active = json.loads(machine.run(f"{ask}/calibrations/current").text)["applied"]["calibration_id"]
    shown = [f"Version handeyed {release_of(story)}", "State Ready", f"CalibrationId {active}"]
    machine.until(f"/opt/mock/bin/python3 /root/mes.py {story.key}", shown)
    user = machine.run("ps -o user= -p $(systemctl show --property=MainPID --value handeyed-opcua)").text.strip()
    if user in ("root", "handeyed"):
        raise Failed(f"the gateway runs as {user}")


def ask_for_help(story: Story) -> None:
    """The bundle of a cell with keys holds the daemon's real answers, and no key."""
    story.shown("handeyed support-bundle /etc/handeyed/handeyed.toml")
    story.machine.run(
        "rm -rf /tmp/bundle && mkdir /tmp/bundle && tar -xzf /root/handeyed-support-*.tar.gz -C /tmp/bundle"
    )
    read = "cat /tmp/bundle/handeyed-support/daemon-"
    expect(story.machine.run(f"{read}ready.txt"), '"ready"')
    expect(story.machine.run(f"{read}metrics.txt"), "handeyed_store_sound 1")
    expect(story.machine.run(f"{read}runs.txt"), '"runs"')
    if story.machine.run(f"grep -rF {story.key} /tmp/bundle", check=False).status == 0:
        raise Failed("the bundle holds the key")


def back_up(story: Story) -> None:
    """A backup while it runs; restored into an empty store it has the same calibrations."""
    ask = f"curl -s --cacert /etc/handeyed/tls/authority.pem {AUTHORIZATION} https://127.0.0.1:8372/calibrations"
    before = story.machine.run(ask).text
    story.shown("runuser -u handeyed -- handeyed backup /etc/handeyed/handeyed.toml --out /var/tmp/handeyed.tar")
    story.shown("systemctl stop handeyed")
    story.shown("mkdir /var/lib/handeyed.old && mv /var/lib/handeyed/* /var/lib/handeyed.old/")
    story.shown("runuser -u handeyed -- handeyed restore /var/tmp/handeyed.tar /etc/handeyed/handeyed.toml")
    story.shown("systemctl start handeyed")
    story.answers()
    if story.machine.run(ask).text != before:
        raise Failed("the restored store has other calibrations")


def update(story: Story) -> None:
    """An update during a run: it asks nothing, waits, the old release serves meanwhile; then the new one answers."""
    machine = story.machine
    story.offer(repack(story.deb, "0.2.0", story.folder))
    story.shown("apt-get update")
    edited = machine.run(f"sha256sum {SETTINGS}").text
    local = f"curl -s --cacert /etc/handeyed/tls/authority.pem {AUTHORIZATION}"
    url = "https://127.0.0.1:8372"
    run = json.loads(machine.run(f"{local} --json '{{\"manual\": true}}' {url}/calibrate").text)
    installing = story.started("apt-get install --only-upgrade handeyed")
    machine.until("systemctl show --property=StatusText --value handeyed", ["held, run", "waits for its end"], 120)
    assert installing.stdout is not None
    said = ""
    while "No other run begins" not in said:  # apt looks once a second: the operator waits for what it says
        if not (line := installing.stdout.readline()):
            raise Failed(said)
        said += line
    expect(machine.run(f"{local} {url}/page/"), "app.js")  # the release before is whole
    expect(machine.run(f"{local} -X POST {url}/calibrate"), "release 0.2.0 is being installed")
    machine.run(f"{local} -X POST {url}/runs/{run['id']}/abort")  # the operator ends it
    said += installing.communicate(timeout=180)[0]
    if installing.returncode or "0.2.0 runs" not in said:
        raise Failed(said)
    expect(machine.run("handeyed --version"), "handeyed 0.2.0")
    expect(story.shown("handeyed health /etc/handeyed/handeyed.toml"), "handeyed 0.2.0 answers")
    if machine.run(f"sha256sum {SETTINGS}").text != edited:
        raise Failed("the update changed the settings")


def update_to_a_broken_release(story: Story) -> None:
    """A release that does not answer gives way to the one before; apt says that it failed, and why."""
    broken = story.place(repack(story.deb, "0.2.1", story.folder, broken=True))
    ran = story.shown("apt-get install ./handeyed_VERSION_amd64.deb", check=False, VERSION=broken)
    expect(ran, "0.2.1 does not answer", "0.2.0 runs again", "broken on purpose")
    if ran.status == 0:
        raise Failed("apt-get says that the broken release is installed")
    expect(story.shown("handeyed health /etc/handeyed/handeyed.toml"), "handeyed 0.2.0 answers")
    story.shown("apt-get install --allow-downgrades handeyed=VERSION", VERSION=f"0.2.0+{suffix(story)}")
    expect(story.shown("handeyed health /etc/handeyed/handeyed.toml"), "handeyed 0.2.0 answers")


def roll_back(story: Story) -> None:
    """Back to the release before, at once, and by the package; a run in progress is not waited for with --now."""
    machine, first = story.machine, story.place(story.deb)
    expect(story.shown("handeyed-release back"), "runs")
    expect(story.shown("handeyed health /etc/handeyed/handeyed.toml"), f"handeyed {release_of(story)} answers")
    expect(machine.run("handeyed-release back --now"), "0.2.0 runs")
    story.shown("apt-get install --allow-downgrades ./handeyed_VERSION_amd64.deb", VERSION=first)
    expect(machine.run("dpkg -s handeyed"), f"Version: {first}")
    expect(story.shown("handeyed health /etc/handeyed/handeyed.toml"), f"handeyed {release_of(story)} answers")


def remove(story: Story) -> None:
    """Removed, settings and data stay; purged, nothing points to what is gone."""
    machine = story.machine
    story.shown("apt-get remove handeyed")
    machine.run(f'test -e {SETTINGS} && test "$(ls /opt/handeyed)" = extras')
    machine.run("rm -r /opt/handeyed")  # what its administrator put there
    expect(story.shown("apt-get purge handeyed"), "What was measured stays in /var/lib/handeyed")
    story.shown("rm -f /etc/apt/sources.list.d/handeyed.list /usr/share/keyrings/handeyed.gpg")
    named = "find /etc /opt /usr /lib -name '*handeyed*' -not -path '/opt/mock/*'"
    dangling = "find /etc -xtype l -lname '*handeyed*'"
    left = machine.run(f"{named}; {dangling}").text
    if left.strip():
        raise Failed(f"left behind: {left}")
    machine.run("test -d /var/lib/handeyed/runs")
    story.shown("rm -r /var/lib/handeyed && deluser handeyed")


def suffix(story: Story) -> str:
    """deb12, or of another Debian."""
    return version_of(story.deb).rpartition("+")[2]


def release_of(story: Story) -> str:
    """The release of the package that was built, as `handeyed --version` prints it."""
    return version_of(story.deb).rpartition("+")[0].replace("~", ".")


STEPS: tuple[Callable[[Story], None], ...] = (
    install, connect, calibrate, look, kill, hang, wrong_settings, restarts, late_address, reload, fragment, lock_up,
    show_over_opc_ua, ask_for_help, back_up, update, update_to_a_broken_release, roll_back, remove,
)  # fmt: skip
