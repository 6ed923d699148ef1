"""A folder as a controller's HOME or a backup of it: its tasks, modules, signals and EGM devices, whoever wrote them.

Understood are a HOME with configuration files anywhere below it, a backup (HOME, RAPID/TASKn, SYSPAR), and a folder
with nothing but modules, which are those of the motion task.
"""

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

from mock_robot.rapid.configuration import FACTORY_TASK, Fragments, Instance, TaskPlan
from mock_robot.rapid.errors import RapidProgramError, RapidSyntaxError
from mock_robot.rapid.program import PersistentMemory, Program, Source
from mock_robot.rapid.signals import Signal
from mock_robot.rapid.syntax import parse_module
from mock_robot.rapid.tasks import ProgramTask
from mock_robot.rapid.types import SIGNAL_TYPES
from protocols.cfg_file import parse_cfg

MODULES = (".mod", ".sys", ".modx", ".sysx", ".prg")
EGM_PORT = 6510
_PRELUDE = re.compile(r"\A(?:\s*%%%.*?%%%)?", re.DOTALL)
_BACKUP_TASK = re.compile(r"TASK(\d+)", re.IGNORECASE)


@dataclass(frozen=True)
class LoadProblem:
    """A module that does not load, and the first thing in it that is not known."""

    file: str
    what: str


@dataclass(frozen=True)
class HomeFragments(Fragments):
    """Configuration and modules found anywhere below the folder. Types and attributes are taken as they are."""

    def read(self, domain: str) -> dict[str, list[Instance]]:
        """Instances of every configuration file of that domain, by type."""
        found: dict[str, list[Instance]] = {}
        for path in _files(self.modules, (".cfg",)):
            file = parse_cfg(_text(path))
            if file.domain == domain:
                for each in file.instances:
                    found.setdefault(each.kind, []).append(each.attributes)
        return found

    def egm_port(self, device: Instance) -> int | None:
        """The device's port, at the loopback address instead of its own: the mock sends nothing into a plant."""
        port = device.get("RemotePortNumber", "")
        return int(port) if port.isdigit() else EGM_PORT

    def text(self, module: str) -> str:
        """Text of a module's file, found by its name. Raises RapidProgramError."""
        found = [path for path in _files(self.modules, MODULES) if path.name.casefold() == module.casefold()]
        if not found:
            raise RapidProgramError("SYS.cfg", 0, f"the module {module} is not in {self.modules}")
        return module_text(found[0])

    def task_plans(self) -> list[TaskPlan]:
        """Tasks that have modules: those of the configuration, with the modules it names and those of a backup.

        Modules that no configuration names are the motion task's, unless a backup has them in a task's folder.
        """
        system = self.read("SYS")
        tasks = {each["Name"]: each for each in system.get("CAB_TASKS", []) if "Name" in each}
        tasks.setdefault(FACTORY_TASK, {"Name": FACTORY_TASK, "Type": "NORMAL", "MotionTask": ""})
        named: list[Instance] = [each for each in system.get("CAB_TASK_MODULES", []) if each.get("File", "")]
        sources: dict[str, list[Source]] = {name: [] for name in tasks}
        everywhere = []
        for each in named:
            file = re.split(r"[/\\:]", each["File"])[-1]
            source = Source(file, self.text(file), "Shared" in each)
            if "Shared" in each or "AllTask" in each:
                everywhere.append(source)
            elif each.get("Task") in sources:
                sources[each["Task"]].append(source)
        for task, path in self._loose(tasks, {re.split(r"[/\\:]", each["File"])[-1].casefold() for each in named}):
            sources[task].append(Source(path.name, module_text(path)))
        return [
            TaskPlan(name, "MotionTask" in task, task.get("Type", "NORMAL").upper(), False, (*everywhere, *own))
            for name, task in tasks.items()
            if (own := sources[name])
        ]

    def _loose(self, tasks: Iterable[str], named: set[str]) -> Iterator[tuple[str, Path]]:
        """Modules that no configuration names, with their task."""
        order = [*tasks]
        backup = any(_BACKUP_TASK.fullmatch(part.name) for part in self.modules.rglob("TASK*"))
        for path in _files(self.modules, MODULES):
            if path.name.casefold() in named:
                continue
            numbers = [int(found[1]) for part in path.parts if (found := _BACKUP_TASK.fullmatch(part))]
            if numbers:
                yield order[min(numbers[-1], len(order)) - 1], path
            elif not (backup or named):
                yield FACTORY_TASK, path

    def signals(self) -> dict[str, Signal]:
        """Signals by name; system outputs are left low."""
        eio = self.read("EIO")
        networks = {each.get("Name", "").upper(): each.get("Name", "") for each in eio.get("INDUSTRIAL_NETWORK", [])}
        places = {
            each.get("Name", ""): f"{networks.get(kind[:-7], 'Local')}/{each.get('Name', '')}"
            for kind, instances in eio.items()
            for each in instances
            if kind.endswith("_DEVICE")
        }
        return {
            each["Name"]: Signal(
                each["Name"],
                each["SignalType"],
                written=each.get("Access") == "All",
                place=places.get(each.get("Device", ""), each.get("Device", "") and f"Local/{each['Device']}"),
            )
            for each in eio.get("EIO_SIGNAL", [])
            if each.get("SignalType") in SIGNAL_TYPES and "Name" in each
        }


def module_text(path: Path) -> str:
    """A module's text, without the header of older files (`%%% VERSION ... %%%`)."""
    return _PRELUDE.sub("", _text(path), count=1)


def load_problems(folder: Path) -> tuple[int, list[LoadProblem]]:
    """Number of modules below a folder, and those that do not load by themselves.

    What another module of the same task of a backup, or else of the same folder, declares counts as known: all of them
    are declared together first where that is possible.
    """
    problems, count, home = [], 0, HomeFragments(folder, 6)
    signals = home.signals()
    for path in _files(folder, MODULES):
        count += 1
        try:
            of_task = next((each for each in path.parents if _BACKUP_TASK.fullmatch(each.name)), path.parent)
            beside = [other for other in _files(of_task, MODULES) if other != path]
            load_module(path, beside, signals)
        except (RapidSyntaxError, RapidProgramError) as error:
            problems.append(LoadProblem(str(path.relative_to(folder)), str(error)))
    return count, problems


def load_module(path: Path, beside: Iterable[Path] = (), signals: Mapping[str, Signal] = MappingProxyType({})) -> None:
    """Parse and compile one module with those beside it. Raises RapidSyntaxError, RapidProgramError."""
    own = Source(path.name, module_text(path))
    if sum(each < " " and each not in "\t\r\n\f\v" for each in own.text) > 0.02 * len(own.text):
        raise RapidProgramError(path.name, 1, "the module is encoded: only a controller reads it")
    try:
        _compile_all([own], signals)
    except RapidProgramError:
        others = [source for other in beside if (source := _parse_or_none(other)) is not None]
        if not others:
            raise
        _compile_all([own, *others], signals, only=own)


def _parse_or_none(path: Path) -> Source | None:
    source = Source(path.name, module_text(path))
    try:
        parse_module(source.text, source.name)
    except RapidSyntaxError:
        return None
    return source


def _compile_all(sources: list[Source], signals: Mapping[str, Signal], only: Source | None = None) -> None:
    task = ProgramTask(FACTORY_TASK, lambda task, stopped: None, True)
    Program(task, PersistentMemory(), signals).load(sources, only=only)


def _files(folder: Path, suffixes: tuple[str, ...]) -> list[Path]:
    return sorted(path for path in folder.rglob("*") if path.is_file() and path.suffix.lower() in suffixes)


def _text(path: Path) -> str:
    return path.read_bytes().removeprefix(b"\xef\xbb\xbf").decode("latin-1")
