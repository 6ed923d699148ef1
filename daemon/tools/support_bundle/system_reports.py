"""Reports of the running daemon and the system; one that does not answer is replaced by the reason."""

import shutil
import ssl
import subprocess
from collections.abc import Sequence
from contextlib import suppress

import httpx

from daemon.config.settings import Settings

MAX_ANSWER_S = 5.0
MAX_ANSWER_BYTES = 5_000_000
LOG_LINES = 5000
PAGES = ("/health", "/ready", "/metrics", "/runs?limit=5")

COMMANDS: dict[str, tuple[str, ...]] = {
    "log.txt": ("journalctl", "-u", "handeyed", "-n", str(LOG_LINES), "-o", "short-iso-precise", "--no-pager"),
    "service.txt": ("systemctl", "show", "handeyed", "-p", "ActiveState,SubState,NRestarts,Result,ExecMainStatus,"
                    "ActiveEnterTimestamp,WatchdogTimestamp,MemoryCurrent,TasksCurrent"),
}  # fmt: skip


def fetch_pages(settings: Settings, authorization: str | None) -> dict[str, str]:
    """The daemon's answers to PAGES by path. `authorization`: the header's value; None: without a key."""
    scheme = "https" if getattr(settings.server, "certificate", None) else "http"
    host = f"[{settings.server.host}]" if ":" in settings.server.host else settings.server.host
    pages: dict[str, str] = {}
    with httpx.Client(
        base_url=f"{scheme}://{host}:{settings.server.port}",
        timeout=MAX_ANSWER_S,
        trust_env=False,
        verify=_certificate(settings.server.certificate),
        headers={} if authorization is None else {"Authorization": authorization},
    ) as client:
        for path in PAGES:
            try:
                pages[path] = _answer_of(client, path)
            except httpx.HTTPError as error:
                pages[path] = f"no answer: {type(error).__name__}: {error}"
                break
    return pages


def _certificate(file: str | None) -> ssl.SSLContext:
    """TLS that trusts the certificate of the settings only: the key goes to our own daemon."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname = False
    context.verify_flags |= ssl.VerifyFlags.VERIFY_X509_PARTIAL_CHAIN
    if file is not None:
        with suppress(OSError):  # ssl.SSLError is one: then nothing is trusted, and the page says so
            context.load_verify_locations(file)
    return context


def _answer_of(client: httpx.Client, path: str) -> str:
    """Status and the first MAX_ANSWER_BYTES of the answer, as sent: another program may listen at the port."""
    content = bytearray()
    with client.stream("GET", path, headers={"Accept-Encoding": "identity"}) as answer:
        for piece in answer.iter_raw():
            content += piece
            if len(content) > MAX_ANSWER_BYTES:
                break
    return f"{answer.status_code}\n{content[:MAX_ANSWER_BYTES].decode('utf-8', 'replace')}"


def output_of(command: Sequence[str]) -> str:
    """What a system program prints, or why it could not be run."""
    if shutil.which(command[0]) is None:
        return f"{command[0]} is not on this machine"
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=30, check=False, errors="replace", stdin=subprocess.DEVNULL
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        return f"{command[0]} did not answer: {error}"
    return done.stdout + done.stderr
