"""The bundle: a .tar.gz of texts, each without secrets. What cannot be gathered says so in its place."""

import io
import json
import sqlite3
import tarfile
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from calibration.errors import DocumentError
from daemon.config.settings import Settings, load_settings
from daemon.runtime.durable_files import write_durably
from daemon.runtime.version import SOFTWARE
from daemon.store.database import storage_errors
from daemon.tools.support_bundle.redaction import redacted, without_secrets
from daemon.tools.support_bundle.store_summary import last_runs, summary_of
from daemon.tools.support_bundle.system_reports import COMMANDS, daemon_says, output_of
from daemon.tools.support_bundle.versions import about_the_machine

SESSIONS = 5
"""Runs whose session.json (poses and names of pictures, no picture) goes along."""

LOG_BYTES = 20_000_000

README = """\
{software}, {at}
A support bundle. Settings, log and everything else are shown without passwords, keys, tokens and codes; still, look at
it before you send it. No picture and no cloud is inside.
"""


@dataclass(frozen=True)
class Bundle:
    """Texts by file name."""

    files: dict[str, str]

    def write(self, target: Path, at: datetime) -> int:
        """As .tar.gz, whole or not at all; answers its size. Raises StorageError."""
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


def gather(config: Path, at: datetime, log_file: Path | None = None) -> Bundle:
    """Everything that can be had; settings that cannot be loaded are no reason to stop."""
    files = {"README.txt": README.format(software=SOFTWARE, at=at.isoformat(timespec="seconds"))}
    files["settings.json"] = _told(lambda: without_secrets(tomllib.loads(config.read_text(encoding="utf-8"))))
    try:
        settings = load_settings(config)
    except DocumentError as error:
        files["settings-problems.txt"] = redacted("\n".join(str(problem) for problem in error.problems))
        return Bundle({**files, **_system(log_file)})
    store = Path(settings.storage.folder)
    files["machine.json"] = _told(lambda: about_the_machine(store))
    files["store.json"] = _told(lambda: without_secrets(summary_of(store)))
    files["runs.json"] = _told(lambda: without_secrets(last_runs(store)))
    files.update(_sessions(store))
    files.update(_daemon(settings))
    return Bundle({**files, **_system(log_file)})


def _told(gathered: Callable[[], Any]) -> str:
    """As JSON; or why not."""
    try:
        return json.dumps(gathered(), indent=1, default=str)
    except (OSError, ValueError, sqlite3.Error) as error:
        return json.dumps({"could not be gathered": redacted(f"{type(error).__name__}: {error}")})


def _sessions(store: Path) -> dict[str, str]:
    """Names sort by time."""
    found = sorted((store / "runs").glob("*/session.json"), reverse=True)[:SESSIONS]
    return {
        f"sessions/{file.parent.name}.json": _told(lambda file=file: without_secrets(json.loads(file.read_text())))  # type: ignore[misc]
        for file in found
    }


def _daemon(settings: Settings) -> dict[str, str]:
    said = daemon_says(settings)
    return {f"daemon{path.partition('?')[0].replace('/', '-')}.txt": redacted(text) for path, text in said.items()}


def _system(log_file: Path | None) -> dict[str, str]:
    files = {name: redacted(output_of(command)) for name, command in COMMANDS.items()}
    if log_file is not None:
        try:
            files["log.txt"] = redacted(log_file.read_bytes()[-LOG_BYTES:].decode("utf-8", "replace"))
        except OSError as error:
            files["log.txt"] = f"{log_file}: {error.strerror}"
    return files
