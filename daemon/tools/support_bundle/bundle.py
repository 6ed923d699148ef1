"""The bundle: a .tar.gz of redacted texts, gathered beside the daemon or in it. A part that cannot be gathered is
replaced by the reason."""

import io
import json
import os
import shutil
import sqlite3
import subprocess
import tarfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any

import httpx

from calibration.errors import DocumentError
from daemon.access.errors import CertificateUnusable
from daemon.access.tls_context import pinned
from daemon.config.settings import Settings, load_settings, read_settings
from daemon.errors import StorageError
from daemon.runtime.durable_files import write_durably
from daemon.runtime.key_redaction import redact_keys
from daemon.runtime.version import SOFTWARE
from daemon.store.database import storage_errors
from daemon.tools.support_bundle.redaction import redact, redact_lines, redact_values
from daemon.tools.support_bundle.store_summary import last_events, last_runs, summarise_audit, summarise_store
from daemon.tools.support_bundle.versions import describe_machine
from registration.io.regular_file import open_regular, read_regular

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
    certificate = settings.server.certificate
    pages: dict[str, str] = {}
    try:
        tls = True if certificate is None else pinned(certificate)
    except CertificateUnusable as error:
        return {PAGES[0]: f"not asked: {error}"}
    headers = {} if authorization is None else {"Authorization": authorization}
    with httpx.Client(
        base_url=settings.server.local_url, timeout=MAX_ANSWER_S, trust_env=False, verify=tls, headers=headers
    ) as client:
        for path in PAGES:
            try:
                pages[path] = _answer_of(client, path)
            except httpx.HTTPError as error:
                pages[path] = f"no answer: {type(error).__name__}: {error}"
                break
    return pages


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


MAX_SESSIONS = 5
"""Number of runs whose session.json (poses and picture names, no pictures) is included."""

MAX_LOG_BYTES = 20_000_000
MAX_TEXT = 5_000_000
"""Limits of a log file that is named, and in characters of every other text, of which a log keeps the end."""

MAX_PICTURES_BYTES = 40_000_000
"""Of all pictures together; further ones are left out."""

README = """\
{software}, {at}
A support bundle. Settings, log and everything else are shown without passwords, keys, tokens and codes; still, look at
it before you send it. {pictures} pictures and no cloud are inside.
"""


@dataclass(frozen=True)
class SupportBundle:
    """The texts of the bundle, and pictures, by file name."""

    files: dict[str, str]
    pictures: dict[str, bytes] = field(default_factory=dict)

    def pack(self, at: datetime) -> bytes:
        """The .tar.gz."""
        readme = README.format(
            software=SOFTWARE, at=at.isoformat(timespec="seconds"), pictures=len(self.pictures) or "No"
        )
        texts = {name: text.encode("utf-8", "replace") for name, text in {"README.txt": readme, **self.files}.items()}
        out = io.BytesIO()
        with tarfile.open(fileobj=out, mode="w:gz", compresslevel=6) as archive:
            for name, content in {**texts, **self.pictures}.items():
                entry = tarfile.TarInfo(f"handeyed-support/{name}")
                entry.size, entry.mtime = len(content), int(at.timestamp())
                archive.addfile(entry, io.BytesIO(content))
        return out.getvalue()

    def write(self, target: Path, at: datetime) -> int:
        """Write the .tar.gz atomically; returns its size in bytes. Raises StorageError."""
        content = self.pack(at)
        with storage_errors(target):
            write_durably(target, [content])
        return len(content)


def gather(config: Path, log_file: Path | None = None, authorization: str | None = None) -> SupportBundle:
    """Gather the bundle beside the daemon; without valid settings, only what does not depend on them.

    `authorization`: what the daemon is asked with, once there are keys.
    """
    files = {"settings.json": _json_or_error(lambda: redact_values(read_settings(config)[0]))}
    try:
        settings = load_settings(config)
    except DocumentError as error:
        files["settings-problems.txt"] = redact("\n".join(str(problem) for problem in error.problems))
        return SupportBundle({**files, **_system(log_file)})
    return SupportBundle(
        {
            **files,
            **_of_store(Path(settings.storage.folder)),
            **_pages(fetch_pages(settings, authorization)),
            **_system(log_file),
        }
    )


def gather_in_daemon(settings: Settings, pages: Mapping[str, str], log: str, *, pictures: bool) -> SupportBundle:
    """Gather the bundle in the daemon: with its settings as loaded, its answers by path, and the lines that it logged.

    `pictures`: with those of the newest run that has any, MAX_PICTURES_BYTES at the most.
    """
    store = Path(settings.storage.folder)
    files = {
        "settings.json": _json_or_error(lambda: redact_values(settings.model_dump(mode="json"))),
        **_of_store(store),
        **_pages(pages),
        **_system(None),
        "log-since-start.txt": redact_lines(log[-MAX_TEXT:]),
    }
    return SupportBundle(files, _pictures(store) if pictures else {})


def _of_store(store: Path) -> dict[str, str]:
    gathered: dict[str, Callable[[], Any]] = {
        "machine.json": partial(describe_machine, store),
        "store.json": lambda: redact_values(summarise_store(store)),
        "runs.json": lambda: redact_values(last_runs(store)),
        "events.json": lambda: redact_values(last_events(store)),
        "audit.json": lambda: redact_values(summarise_audit(store)),
    }
    return {**{name: _json_or_error(one) for name, one in gathered.items()}, **_sessions(store)}


def _json_or_error(gathered: Callable[[], Any]) -> str:
    """The JSON of the returned value, or of the reason why it could not be gathered."""
    try:
        return json.dumps(gathered(), indent=1, default=str)
    except (OSError, ValueError, RecursionError, sqlite3.Error, DocumentError, StorageError) as error:
        return json.dumps({"could not be gathered": redact(f"{type(error).__name__}: {error}")})


def _sessions(store: Path) -> dict[str, str]:
    """session.json of the latest MAX_SESSIONS runs, whose ids sort by time."""
    found = sorted((store / "runs").glob("*/session.json"), reverse=True)[:MAX_SESSIONS]

    def load(file: Path) -> Any:
        return redact_values(json.loads(read_regular(file, MAX_TEXT)))

    return {f"sessions/{redact_keys(file.parent.name)}.json": _json_or_error(partial(load, file)) for file in found}


def _pictures(store: Path) -> dict[str, bytes]:
    """Those of the newest run with pictures."""
    newest = next(iter(sorted({file.parent for file in (store / "runs").glob("*/*.png")}, reverse=True)), None)
    found: dict[str, bytes] = {}
    rest = MAX_PICTURES_BYTES
    for file in sorted(newest.glob("*.png")) if newest else []:
        try:
            content = read_regular(file, rest)
        except OSError:  # damaged, gone, or too large for what is left
            continue
        found[f"pictures/{redact_keys(file.parent.name)}/{redact_keys(file.name)}"] = content
        rest -= len(content)
    return found


def _pages(pages: Mapping[str, str]) -> dict[str, str]:
    return {
        f"daemon{path.partition('?')[0].replace('/', '-')}.txt": redact_lines(text[:MAX_TEXT])
        for path, text in pages.items()
    }


def _system(log_file: Path | None) -> dict[str, str]:
    files = {name: redact_lines(output_of(command)[-MAX_TEXT:]) for name, command in COMMANDS.items()}
    if log_file is not None:
        try:
            with open_regular(log_file) as log:
                log.seek(max(0, log.seek(0, os.SEEK_END) - MAX_LOG_BYTES))
                files["log.txt"] = redact_lines(log.read(MAX_LOG_BYTES).decode("utf-8", "replace"))
        except OSError as error:
            files["log.txt"] = f"{log_file}: {error.strerror}"
    return files
