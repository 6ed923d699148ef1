"""The bundle: a .tar.gz of redacted texts, gathered beside the daemon or in it. A part that cannot be gathered is
replaced by the reason."""

import io
import json
import os
import platform
import re
import shutil
import sqlite3
import subprocess
import tarfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass, field
from datetime import datetime
from functools import partial
from importlib import metadata
from pathlib import Path
from typing import Any

import httpx

from calibration.errors import DocumentError
from daemon.access.errors import CertificateUnusable
from daemon.access.tls_context import pinned
from daemon.config.settings import Settings, load_settings, read_settings
from daemon.errors import StorageError
from daemon.runtime.durable_files import write_durably
from daemon.runtime.logs import redact_keys
from daemon.runtime.version import SOFTWARE
from daemon.store.audit_log import check_audit_log
from daemon.store.database import DATABASE_NAME, storage_errors
from registration.io.regular_file import open_regular, read_regular

MAX_ROWS = 50
MAX_EVENTS = 500


def summarise_store(folder: Path) -> dict[str, Any]:
    """Schema, integrity, row counts, history and calibrations. Raises sqlite3.Error."""
    with _open(folder) as db:
        return {
            "schema": db.execute("PRAGMA user_version").fetchone()[0],
            "integrity": [row[0] for row in db.execute("PRAGMA quick_check(5)")],
            "tables": [{"name": name, "rows": rows} for name, rows in _counts(db)],
            "applied": _rows(db, "SELECT calibration_id, applied_at, applied_by FROM applied ORDER BY sequence DESC"),
            "calibrations": _rows(
                db, "SELECT id, run_id, created_at, accepted FROM calibrations ORDER BY created_at DESC"
            ),
        }


def last_runs(folder: Path) -> list[dict[str, Any]]:
    """The latest 50 runs, newest first, with cause and result; without the points of verifications."""
    with _open(folder) as db:
        rows = _rows(
            db,
            "SELECT id, kind, state, station, stations, cause, created_at, updated_at, request, result"
            " FROM runs ORDER BY created_at DESC, id DESC",
        )
    parsed = [{**row, **{name: _parse(row[name]) for name in ("cause", "request", "result")}} for row in rows]
    for result in (row["result"] for row in parsed):
        if isinstance(result, dict) and isinstance(result.get("verification"), dict):
            result["verification"]["points"] = "left out"
    return parsed


def last_events(folder: Path) -> list[dict[str, Any]]:
    """The latest 500 events, newest first. Raises sqlite3.Error."""
    with _open(folder) as db:
        rows = _rows(db, "SELECT number, kind, data FROM events ORDER BY number DESC", MAX_EVENTS)
    return [{**row, "data": _parse(row["data"] or None)} for row in rows]


def summarise_audit(folder: Path) -> dict[str, Any]:
    """Whether the audit log is whole, and its latest 50 rows. Raises StorageError, sqlite3.Error."""
    count, flaws = check_audit_log(folder / DATABASE_NAME, [])
    with _open(folder) as db:
        rows = _rows(db, "SELECT sequence, at, actor, role, action, subject, detail FROM audit ORDER BY sequence DESC")
    latest = [{**row, "detail": _parse(row["detail"])} for row in rows]
    return {"whole": not flaws, "rows": count, "flaws": flaws[:20], "latest": latest}


def _open(folder: Path) -> closing[sqlite3.Connection]:
    """The database of a store, for reading only. Raises sqlite3.Error."""
    return closing(sqlite3.connect(f"{(folder / DATABASE_NAME).resolve().as_uri()}?mode=ro", uri=True, timeout=2))


def _counts(db: sqlite3.Connection) -> Iterator[tuple[str, int]]:
    names = [row[0] for row in db.execute("SELECT name FROM sqlite_master WHERE type = 'table' ORDER BY name")]
    for name in names:
        quoted = name.replace('"', '""')
        yield name, db.execute(f'SELECT COUNT(*) FROM "{quoted}"').fetchone()[0]  # noqa: S608 - a name, quoted


def _rows(db: sqlite3.Connection, query: str, limit: int = MAX_ROWS) -> list[dict[str, Any]]:
    cursor = db.execute(f"{query} LIMIT {limit}")
    names = [column[0] for column in cursor.description]
    return [dict(zip(names, row, strict=True)) for row in cursor]


def _parse(text: str | None) -> Any:
    return None if text is None else json.loads(text)


def describe_machine(store: Path) -> dict[str, Any]:
    """System, cores, load, memory, disk of the store, and the installed packages."""
    existing = next(place for place in (store, *store.parents) if place.exists())
    disk = shutil.disk_usage(existing)
    return {
        "system": platform.platform(),
        "python": platform.python_version(),
        "cores": os.cpu_count(),
        "load": os.getloadavg(),
        "memory": _first_lines(Path("/proc/meminfo"), 3),
        "uptime_s": _first_lines(Path("/proc/uptime"), 1),
        "store": str(store),
        "disk_bytes": {"total": disk.total, "free": disk.free},
        "packages": {found.name: found.version for found in metadata.distributions()},
    }


def about_software() -> dict[str, Any]:
    """The daemon's version, Python's, and the installed packages with their licences, sorted by name."""
    packages = [
        {"name": found.name, "version": found.version, "licence": _licence(found)}
        for found in sorted(metadata.distributions(), key=lambda found: found.name.lower())
    ]
    return {"software": SOFTWARE, "licence": "Apache-2.0", "python": platform.python_version(), "packages": packages}


def _licence(found: metadata.Distribution) -> str:
    """The SPDX expression of a package, else the first line of its licence field; empty when it states none."""
    named = [found.metadata[field] for field in ("License-Expression", "License") if field in found.metadata]
    return str(named[0]).strip().partition("\n")[0][:100] if named else ""


def _first_lines(file: Path, count: int) -> list[str]:
    try:
        return file.read_text().splitlines()[:count]
    except OSError:
        return []


REMOVED = "[removed]"

SECRET_KEY = re.compile(r"secret|password|passwd|passphrase|token|credential|authorization|cookie|(^|_)key($|s|_)|hash")
"""Keys of settings and columns whose values are removed, at any depth."""

SECRETS: tuple[tuple[re.Pattern[str], str], ...] = (
    (re.compile(r"-----BEGIN [A-Z ]+-----.*?(-----END [A-Z ]+-----|\Z)", re.DOTALL), REMOVED),
    # user:password@ of an address, and its query
    (re.compile(r"(?P<kept>[a-z][a-z0-9+.-]{0,20}://)[^/\s\"'@]+@", re.IGNORECASE), rf"\g<kept>{REMOVED}@"),
    (re.compile(r"(?P<kept>(https?|rtsp|wss?)://[^\s\"'?#]{1,500}\?)[^\s\"']+", re.IGNORECASE), rf"\g<kept>{REMOVED}"),
    (re.compile(r"(?P<kept>\b(bearer|basic)\s+)[A-Za-z0-9._~+/=-]+", re.IGNORECASE), rf"\g<kept>{REMOVED}"),
    (
        re.compile(
            r"(?P<kept>(secret|password|passwd|passphrase|token|api[_-]?key|authorization|cookie)[\w-]{0,40}"
            r"[\"']?\s{0,9}[=:]\s{0,9})(\"[^\"]*\"|'[^']*'|[^\s,;}\]]+)",
            re.IGNORECASE,
        ),
        rf"\g<kept>{REMOVED}",
    ),
    # the one-time set-up code, and anything as long as a key
    (re.compile(r"\b[A-Z0-9]{4}(-[A-Z0-9]{4}){2,}\b"), REMOVED),
    (re.compile(r"(?<![\w/.-])[A-Za-z0-9_+=-]{32,}(?![\w/.-])"), REMOVED),
)
"""Patterns and their replacements, with bounded repetitions: a hostile log must not take quadratic time.

Long names beside a slash or a dot are kept: they are files and folders."""


def redact(text: str) -> str:
    """The text with everything that looks like a secret replaced by "[removed]"."""
    text = redact_keys(text)
    for pattern, replacement in SECRETS:
        text = pattern.sub(replacement, text)
    return text


PIECE = 1 << 16
"""Characters in which a long text is redacted: a pattern holds the interpreter, and with it the event loop."""


def redact_lines(text: str) -> str:
    """As `redact`, of a log, in pieces of whole lines; keys in PEM are removed from the whole first."""
    pem, replacement = SECRETS[0]
    lines = pem.sub(replacement, text).splitlines(keepends=True)
    pieces, length = [[]], 0  # type: list[list[str]], int
    for line in lines:
        if length > PIECE:
            pieces.append([])
            length = 0
        pieces[-1].append(line)
        length += len(line)
    return "".join(redact("".join(piece)) for piece in pieces)


def redact_values(value: Any) -> Any:
    """JSON or TOML data with the values of secret keys removed and every text redacted."""
    if isinstance(value, dict):
        return {
            redact(str(key)): REMOVED if SECRET_KEY.search(str(key).lower()) else redact_values(item)
            for key, item in value.items()
        }
    if isinstance(value, list | tuple):
        return [redact_values(item) for item in value]
    return redact(value) if isinstance(value, str) else value


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
        with suppress(OSError):  # damaged, gone, or too large for what is left
            content = read_regular(file, rest)
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
