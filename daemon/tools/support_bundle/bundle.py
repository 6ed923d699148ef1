"""The bundle: a .tar.gz of redacted texts. A part that cannot be gathered is replaced by the reason."""

import io
import json
import os
import sqlite3
import tarfile
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any

from calibration.errors import DocumentError
from daemon.config.settings import Settings, load_settings
from daemon.runtime.bounded_read import read_bounded
from daemon.runtime.durable_files import write_durably
from daemon.runtime.key_redaction import redact_keys
from daemon.runtime.version import SOFTWARE
from daemon.store.database import storage_errors
from daemon.tools.support_bundle.redaction import redact, redact_values
from daemon.tools.support_bundle.store_summary import last_runs, summarise_store
from daemon.tools.support_bundle.system_reports import COMMANDS, fetch_pages, output_of
from daemon.tools.support_bundle.versions import describe_machine
from registration.io.regular_file import open_regular

MAX_SESSIONS = 5
"""Number of runs whose session.json (poses and picture names, no pictures) is included."""

MAX_LOG_BYTES = 20_000_000

README = """\
{software}, {at}
A support bundle. Settings, log and everything else are shown without passwords, keys, tokens and codes; still, look at
it before you send it. No picture and no cloud is inside.
"""


@dataclass(frozen=True)
class SupportBundle:
    """The texts of the bundle by file name."""

    files: dict[str, str]

    def write(self, target: Path, at: datetime) -> int:
        """Write the .tar.gz atomically; returns its size in bytes. Raises StorageError."""
        out = io.BytesIO()
        with tarfile.open(fileobj=out, mode="w:gz") as archive:
            for name, text in self.files.items():
                content = text.encode("utf-8", "replace")
                entry = tarfile.TarInfo(f"handeyed-support/{name}")
                entry.size, entry.mtime = len(content), int(at.timestamp())
                archive.addfile(entry, io.BytesIO(content))
        with storage_errors(target):
            write_durably(target, [out.getvalue()])
        return len(out.getvalue())


def gather(config: Path, at: datetime, log_file: Path | None = None) -> SupportBundle:
    """Gather the bundle; without valid settings, only what does not depend on them."""
    files = {"README.txt": README.format(software=SOFTWARE, at=at.isoformat(timespec="seconds"))}
    files["settings.json"] = _json_or_error(lambda: redact_values(tomllib.loads(read_bounded(config).decode())))
    try:
        settings = load_settings(config)
    except DocumentError as error:
        files["settings-problems.txt"] = redact("\n".join(str(problem) for problem in error.problems))
        return SupportBundle({**files, **_system(log_file)})
    store = Path(settings.storage.folder)
    files["machine.json"] = _json_or_error(lambda: describe_machine(store))
    files["store.json"] = _json_or_error(lambda: redact_values(summarise_store(store)))
    files["runs.json"] = _json_or_error(lambda: redact_values(last_runs(store)))
    files.update(_sessions(store))
    files.update(_daemon(settings))
    return SupportBundle({**files, **_system(log_file)})


def _json_or_error(gathered: Callable[[], Any]) -> str:
    """The JSON of the returned value, or of the reason why it could not be gathered."""
    try:
        return json.dumps(gathered(), indent=1, default=str)
    except (OSError, ValueError, RecursionError, sqlite3.Error) as error:
        return json.dumps({"could not be gathered": redact(f"{type(error).__name__}: {error}")})


def _sessions(store: Path) -> dict[str, str]:
    """session.json of the latest MAX_SESSIONS runs, whose ids sort by time."""
    found = sorted((store / "runs").glob("*/session.json"), reverse=True)[:MAX_SESSIONS]

    def load(file: Path) -> Any:
        return redact_values(json.loads(read_bounded(file)))

    return {f"sessions/{redact_keys(file.parent.name)}.json": _json_or_error(partial(load, file)) for file in found}


def _daemon(settings: Settings) -> dict[str, str]:
    pages = fetch_pages(settings)
    return {f"daemon{path.partition('?')[0].replace('/', '-')}.txt": redact(text) for path, text in pages.items()}


def _system(log_file: Path | None) -> dict[str, str]:
    files = {name: redact(output_of(command)) for name, command in COMMANDS.items()}
    if log_file is not None:
        try:
            with open_regular(log_file) as log:
                log.seek(max(0, log.seek(0, os.SEEK_END) - MAX_LOG_BYTES))
                files["log.txt"] = redact(log.read(MAX_LOG_BYTES).decode("utf-8", "replace"))
        except OSError as error:
            files["log.txt"] = f"{log_file}: {error.strerror}"
    return files
