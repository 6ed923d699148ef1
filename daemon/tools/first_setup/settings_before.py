"""The settings file of the first set-up: what the one that is there answers, and what of it stays in the new one."""

import re
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Self
from urllib.parse import urlsplit

from calibration.documents.target_text import text_of_target
from calibration.documents.validation import validate_document
from calibration.errors import DocumentError
from daemon.config.server_settings import ServerSettings
from daemon.config.settings import Settings, merge_tables, parse_settings, parse_toml
from daemon.config.toml_text import toml_text
from daemon.runtime.bounded_read import read_document
from daemon.tools.first_setup.answers import EDGES

HEAD = "# What `handeyed init` asked. handeyed.example.toml has every other setting.\n"
STORE = "store"
"""Folder of what the daemon keeps, beside the settings file."""
NOWHERE = "127.0.0.1:9"
"""Where no device answers."""
BLANK: dict[str, Any] = {
    "robot": {"address": f"tcp://{NOWHERE}", "box_mm": [(0, 0, 0), (1, 1, 1)]},
    "camera": {"address": f"http://{NOWHERE}/"},
    "target": {"kind": "chessboard", "columns": 2, "rows": 2, "pitch_mm": 1.0},
    "calibration": {"tolerance_mm": 1.0},
}
"""Settings of a cell that is not set up."""
OF_THE_DAEMON = ("server", "storage")

Tables = dict[str, Any]


@dataclass(frozen=True)
class SettingsBefore:
    """Settings from which answers are proposed, and of which stays what is not asked.

    `settings`: `tables` over BLANK. `problem`: why nothing is taken from the file that is there.
    """

    tables: Tables = field(default_factory=dict)
    origin: str = "settings"
    problem: str = ""

    def __post_init__(self) -> None:
        """Raises DocumentError."""
        _ = self.settings

    @cached_property
    def settings(self) -> Settings:
        data: Tables = {}
        for tables in (BLANK, self.tables):
            merge_tables(data, tables, {}, "")
        return validate_document(Settings, data, self.origin)

    @classmethod
    def of_file(cls, file: Path, port: int) -> Self:
        """Those of the file; where none is there, or can be read: a daemon at `port`, with a store beside the file."""
        server = {} if port == ServerSettings().port else {"port": port}
        blank = {"storage": {"folder": STORE}, "server": server}
        try:
            return cls(parse_toml(read_document(file), str(file)) if file.exists() else blank, str(file))
        except DocumentError as error:
            return cls(blank, problem=f"nothing is taken from {error}")

    def with_answers_of(self, content: bytes, origin: str) -> Self:
        """Those of another file, but for address and store of this daemon. Raises DocumentError."""
        own = {name: self.tables.get(name, {}) for name in OF_THE_DAEMON}
        return replace(self, tables={**parse_toml(content, origin), **own}, origin=origin)

    def answers(self) -> dict[str, str]:
        """By question, those that make these settings; addresses without passwords."""
        usual = _answers_of(SettingsBefore().settings)
        return {name: text for name, text in _answers_of(self.settings).items() if text != usual[name]}

    def lines(self) -> tuple[str, ...]:
        """What a person is to know: lines."""
        further = ", ".join(name for name in self.tables if name not in (*BLANK, *OF_THE_DAEMON))
        return tuple(filter(None, (self.problem, further and f"what is not asked stays as it is: {further}")))

    def with_password(self, answer: str) -> str:
        """The address that `answers` shows as this, as it stands in the settings; any other text as it is."""
        addresses = (self.settings.robot.address, self.settings.camera.address)
        return next((address for address in addresses if without_password(address) == answer), answer)

    def text_with(self, asked: Tables) -> str:
        """The settings file with what was asked, tables as in BLANK, over what is there."""
        data: Tables = {name: {} for name in BLANK}
        merge_tables(data, self.tables, {}, "")
        before, now = (urlsplit(each).hostname for each in (self.settings.robot.address, asked["robot"]["address"]))
        for name in ("base_frame", *(("stop_address",) if before != now else ())):  # that of another robot
            data["robot"].pop(name, None)
        data["calibration"].get("known", {}).pop("target", None)
        data["target"] = {}
        merge_tables(data, asked, {}, "")
        return HEAD + toml_text(data)


def _answers_of(settings: Settings) -> dict[str, str]:
    robot, target, known = settings.robot, settings.target, settings.calibration.known.target
    first, second, *_ = EDGES[type(target)]
    mm = [float(getattr(target, name)) for name in (first, second) if name]
    of_one: Any = {name: round(each / mm[0], 4) for name, each in zip((first, second), mm, strict=False)}
    size = [f"{each:.10g}" for each in mm]
    if known.instrument is not None and known.length_mm is not None:
        size = [f"{known.length_mm:.10g}/{round(known.length_mm / mm[0])}", *size[1:], known.instrument]
    return {
        "controller": without_password(robot.address),
        "model": robot.model or "",
        "camera": without_password(settings.camera.address),
        "setup": "arm" if settings.camera.setup == "eye-in-hand" else "beside",
        "target": text_of_target(replace(target, **of_one)),
        "size": " ".join(size),
        "tolerance": f"{settings.calibration.tolerance_mm:g}",
        "box": " ".join(f"{value:.10g}" for corner in robot.box_mm for value in corner),
    }


def without_password(address: str) -> str:
    """The address without user and password."""
    return re.sub(r"(?<=//)[^/?#]*@", "", address)


def settings_before(file: Path, port: int) -> Settings:
    """Of a daemon whose cell is not set up: no device is there; address, keys and log are as in SettingsBefore."""
    before, folder = SettingsBefore.of_file(file, port).settings, file.resolve().parent
    storage = before.storage.model_copy(update={"folder": str(folder / before.storage.folder)})
    update = {"storage": storage, "server": before.server.beside(folder)}
    return SettingsBefore().settings.model_copy(update=update)


def write_settings(file: Path, text: str) -> Path | None:
    """Write the file; returns where one that was there is kept: FILE.1, FILE.2, ... Raises DocumentError, OSError."""
    parse_settings(text.encode(), str(file))
    new, kept = file.with_name(f"{file.name}.new"), None
    new.write_text(text, encoding="utf-8")
    if file.exists():
        names = (file.with_name(f"{file.name}.{number}") for number in range(1, 1000))
        kept = file.rename(next(path for path in names if not path.exists()))
    new.rename(file)
    return kept
