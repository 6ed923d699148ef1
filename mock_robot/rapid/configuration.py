"""Reads a controller's configuration files: tasks and modules, signals and system outputs, serial ports."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from mock_robot.rapid.errors import RapidProgramError
from mock_robot.rapid.program import Source

Instance = dict[str, str]
_ATTRIBUTE = re.compile(r'-(\w+)(?:\s+("[^"]*"|[^\s"-][^\s"]*))?')
TASK_TYPES = ("NORMAL", "STATIC", "SEMISTATIC")


def instances(text: str) -> dict[str, list[Instance]]:
    """Parse a .cfg by type: each instance maps attributes to values, "" for an attribute without one."""
    found: dict[str, list[Instance]] = {}
    section: list[Instance] = []
    for line in text.replace("\r", "").replace("\\\n", " ").split("\n")[1:]:
        if re.fullmatch(r"[A-Z_0-9]+:", line.strip()):
            section = found.setdefault(line.strip()[:-1], [])
        elif line.strip().startswith("-"):
            section.append({key: value.strip('"') for key, value in _ATTRIBUTE.findall(line)})
    return found


@dataclass(frozen=True)
class TaskPlan:
    """A task declared in SYS.cfg, and its modules, shared ones first."""

    name: str
    motion: bool
    kind: str
    stops_all: bool
    sources: tuple[Source, ...]


def task_plans(folder: Path) -> list[TaskPlan]:
    """Tasks of SYS.cfg, with the text of their modules from the same folder."""
    system = instances((folder / "SYS.cfg").read_text("ascii"))
    modules = system.get("CAB_TASK_MODULES", [])
    plans = []
    for task in system.get("CAB_TASKS", []):
        if task.get("Type") not in TASK_TYPES:
            raise RapidProgramError("SYS.cfg", 0, f"{task.get('Name')}: Type is one of {', '.join(TASK_TYPES)}")
        own = [m for m in modules if "Shared" in m] + [m for m in modules if m.get("Task") == task["Name"]]
        sources = tuple(_source(folder, module) for module in own)
        stops_all = task.get("TrustLevel") in ("SysFail", "SysHalt", "SysStop")
        plans.append(TaskPlan(task["Name"], "MotionTask" in task, task["Type"], stops_all, sources))
    return plans


def _source(folder: Path, module: Instance) -> Source:
    file = module["File"].rpartition("/")[2]
    return Source(file, (folder / file).read_text("ascii"), "Shared" in module)


SystemOutput = Callable[[str], bool]


def signals(folder: Path, outputs: Mapping[str, SystemOutput]) -> dict[str, Callable[[], bool]]:
    """Digital outputs of EIO.cfg, each as a function of its system output. Raises for an unknown status."""
    inputs = instances((folder / "EIO.cfg").read_text("ascii"))
    found: dict[str, Callable[[], bool]] = {}
    for signal in inputs.get("EIO_SIGNAL", []):
        found[signal["Name"]] = _low
    for output in inputs.get("SYSSIG_OUT", []):
        status, signal_name = output["Status"], output["Signal"]
        if status not in outputs:
            raise RapidProgramError("EIO.cfg", 0, f"system output {status} is unknown: {', '.join(sorted(outputs))}")
        if signal_name not in found:
            raise RapidProgramError("EIO.cfg", 0, f"system output {status}: no signal is named {signal_name}")
        found[signal_name] = _bind(outputs[status], output.get("Arg1", ""))
    return found


def _low() -> bool:
    return False


def _bind(output: SystemOutput, argument: str) -> Callable[[], bool]:
    return lambda: output(argument)


def serial_ports(folder: Path) -> tuple[str, ...]:
    """Names a program opens: "com1:" for the channel COM1."""
    ports = instances((folder / "SIO.cfg").read_text("ascii")).get("COM_PHY_CHANNEL", [])
    return tuple(f"{port['Name'].casefold()}:" for port in ports)
