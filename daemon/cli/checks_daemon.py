"""The check through the daemon that holds the cell: whether it runs with this file, and what it says of its devices.

A device that a daemon holds is never opened: an ABB controller would refuse, a camera be taken from the run.
"""

from collections.abc import Callable

from daemon.access.errors import CertificateUnusable
from daemon.cli.local_daemon import client_of
from daemon.cli.output import CheckResult
from daemon.cli.rest_client import connect
from daemon.cli.service import running_service
from daemon.config.settings import Settings, SettingsFile
from handeyed.client import Client
from handeyed.errors import ClientError, NoDaemon

MAX_ANSWER_S = 4.0
WITH_A_KEY = "give a key in HANDEYED_KEY, or check as root or as the daemon's user"


def check_daemon(settings: Settings, loaded: SettingsFile | None) -> list[CheckResult] | None:
    """What the daemon says that holds the cell: the one at the settings' address, or the service of this machine.

    None when there is none: the devices are free then.
    """
    found = _ask(lambda: client_of(settings, MAX_ANSWER_S), loaded)
    service = running_service()
    if found is None and service is not None and not service.is_at(settings.server.local_url):
        found = _ask(lambda: connect(service.url, MAX_ANSWER_S), loaded)
    return found


def _ask(ask: Callable[[], Client], loaded: SettingsFile | None) -> list[CheckResult] | None:
    """The results through one daemon; None when nothing listens there."""
    try:
        with ask() as daemon:
            software = daemon.get("/health")["software"]
            return _results(daemon, f"{software} runs at {daemon.url} and holds the devices", loaded)
    except NoDaemon:
        return None
    except (ClientError, CertificateUnusable, KeyError, TypeError, ValueError) as error:
        where = error.where if isinstance(error, ClientError) else "the port"
        what = error.what if isinstance(error, ClientError | CertificateUnusable) else "no daemon's answer"
        said = f"something answers at {where}, but not as a daemon with these settings ({what}); no device was asked"
        return [CheckResult("daemon", False, said, "see who listens there: ss -ltnp")]


def _results(daemon: Client, runs: str, loaded: SettingsFile | None) -> list[CheckResult]:
    try:
        about, readiness = daemon.get("/about"), daemon.get("/calibrate")
    except ClientError as error:
        return [CheckResult("daemon", True, runs), CheckResult("cell", False, error.what, WITH_A_KEY)]
    other = other_settings(about.get("settings"), loaded)
    if other is not None:
        return [CheckResult("daemon", False, f"{runs}, {other[0]}; no device was asked", other[1])]
    reasons = [CheckResult("cell", False, reason, "put this right at the cell") for reason in readiness["reasons"]]
    running = CheckResult("daemon", True, runs if loaded is None else f"{runs}, with this file")
    return [running, *(reasons or [CheckResult("cell", True, "ready to calibrate")])]


def other_settings(running: dict[str, str] | None, loaded: SettingsFile | None) -> tuple[str, str] | None:
    """How the daemon's settings differ from the file that is checked, and what to do; None when they are the same."""
    if running is None or loaded is None or running["sha256"] == loaded.sha256:
        return None
    if running["file"] == loaded.file:
        return "but with this file as it was when it started", "systemctl restart handeyed; then check again"
    return (
        f"with {running['file']}, which is another than this file",
        "check that one; or stop the daemon to test this one",
    )
