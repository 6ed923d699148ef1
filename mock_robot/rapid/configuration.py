"""Reads a controller's configuration files: tasks and modules, signals and system outputs, serial ports.

Types and attributes are those that real controllers export; another one is refused: a real controller may know more.
RobotWare 6: the union of EIO.cfg, SYS.cfg and SIO.cfg in the public repositories rpiRobotics/abb_motion_program_exec,
PaulaFreudenberger/ABB-Rapid-Git, rafurb886/ABB_EIO, tetov/compas_rcf, joseballester/abb-rapidserver,
panin-anan/abb_SAMXL_Grinding_RAPID, Keen1949/ABB_ROBOT_Socket, EdgarIvanMM/PaletizadoCajasConFrascos and
Fabio-Coder/Robo_ABB_Injetora-Rotinas_de_ajuste. RobotWare 7: what a GoFa with 7.20 lists over RWS, and the backups
beside it (eliasbitsch/MetaMove); zwj12/SignalAutoConfigurationTool writes a header without a layout.
"""

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import MappingProxyType

from mock_robot.rapid.errors import RapidProgramError
from mock_robot.rapid.program import Source
from mock_robot.rapid.signals import Signal
from protocols.cfg_file import parse_cfg

HEADERS: Mapping[tuple[str, int], tuple[str, ...]] = MappingProxyType(
    {
        ("EIO", 6): ("EIO:CFG_1.0:6:1::", "EIO:CFG_1.0::"),
        ("SYS", 6): ("SYS:CFG_1.0:6:0::", "SYS:CFG_1.0::"),
        ("SIO", 6): ("SIO:CFG_1.0:6:1::", "SIO:CFG_1.0::"),
        **{(domain, 7): (f"{domain}:CFG_1.0:7:0::", f"{domain}:CFG_1.0::") for domain in ("EIO", "SYS", "SIO")},
    }
)
"""First lines by domain and RobotWare. OmniCore has no serial port of its own; its SIO has network devices."""

_TYPES: dict[str, dict[str, str]] = json.loads(Path(__file__).with_suffix(".json").read_text("utf-8"))
"""Attributes by RobotWare, then by domain and type; what 7 does not list is as in 6."""

TASK_ARGUMENTS: Mapping[str, str] = MappingProxyType({"TaskExecuting": "Arg2", "Error": "Arg2"})
"""The attribute in which a system output names its task. `Arg1` names a mechanical unit, as in MotSupTrigg."""

FACTORY_TASK = "T_ROB1"
"""The task every controller with one arm is delivered with: a fragment that declares it is a duplicate."""


def attributes_of(domain: str, kind: str, robotware: int) -> frozenset[str] | None:
    """Attributes of a type, or None for a type that no export has."""
    found = _TYPES[str(robotware)].get(f"{domain} {kind}", _TYPES["6"].get(f"{domain} {kind}"))
    return None if found is None else frozenset(found.split())


Instance = dict[str, str]
TASK_TYPES = ("NORMAL", "STATIC", "SEMISTATIC")
TRUST_LEVELS = ("None", "SysFail", "SysHalt", "SysStop")
"""What an error of a task that is not NORMAL does: nothing, or all tasks stop. SysFail when none is given."""


@dataclass(frozen=True)
class Fragments:
    """The configuration files for one RobotWare, 6 or 7, in their own folder beside the modules."""

    modules: Path
    robotware: int

    def read(self, domain: str) -> dict[str, list[Instance]]:
        """Instances of `domain`.cfg by type, or of a variant in its own folder, as egm/SIO; {} without file.

        Raises RapidProgramError for a header, type or attribute that no export of this RobotWare has.
        """
        path = self.modules / f"rw{self.robotware}" / f"{domain}.cfg"
        if not path.exists():
            return {}
        file = parse_cfg(path.read_text("ascii"))
        domain = domain.rpartition("/")[2]
        if file.header not in HEADERS.get((domain, self.robotware), ()):
            raise RapidProgramError(path.name, 1, f"{file.header} is no header of RobotWare {self.robotware}")
        found: dict[str, list[Instance]] = {}
        for each in file.instances:
            known = attributes_of(domain, each.kind, self.robotware)
            if known is None:
                raise RapidProgramError(path.name, each.line, f"no type of {domain} is named {each.kind}")
            if unknown := sorted(each.attributes.keys() - known):
                raise RapidProgramError(path.name, each.line, f"{each.kind} has no attribute {', '.join(unknown)}")
            found.setdefault(each.kind, []).append(each.attributes)
        return found

    def egm_port(self, device: Instance) -> int | None:
        """Port of this machine that a program's EGM sends to."""
        return None

    def text(self, module: str) -> str:
        return (self.modules / module).read_text("ascii")


@dataclass(frozen=True)
class TaskPlan:
    """A task of the controller, and its modules, shared ones first."""

    name: str
    motion: bool
    kind: str
    stops_all: bool
    sources: tuple[Source, ...]


def task_plans(fragments: Fragments) -> list[TaskPlan]:
    """The controller's own motion task and those of SYS.cfg, with the text of their modules."""
    system = fragments.read("SYS")
    modules = system.get("CAB_TASK_MODULES", [])
    factory: Instance = {"Name": FACTORY_TASK, "Type": "NORMAL", "MotionTask": ""}
    plans: list[TaskPlan] = []
    for task in [factory, *system.get("CAB_TASKS", [])]:
        name, kind, trust = task["Name"], task.get("Type", "SEMISTATIC"), task.get("TrustLevel", "SysFail")
        if any(name == plan.name for plan in plans):
            raise RapidProgramError("SYS.cfg", 0, f"the controller has a task {name} already")
        if kind not in TASK_TYPES:
            raise RapidProgramError("SYS.cfg", 0, f"{name}: Type is one of {', '.join(TASK_TYPES)}")
        if trust not in TRUST_LEVELS:
            raise RapidProgramError("SYS.cfg", 0, f"{name}: TrustLevel is one of {', '.join(TRUST_LEVELS)}")
        own = [m for m in modules if "Shared" in m] + [m for m in modules if m.get("Task") == name]
        sources = tuple(
            Source(file := module["File"].rpartition("/")[2], fragments.text(file), "Shared" in module)
            for module in own
        )
        plans.append(TaskPlan(name, "MotionTask" in task, kind, kind != "NORMAL" and trust != "None", sources))
    return plans


SystemOutput = Callable[[str], bool]


def signals(fragments: Fragments, outputs: Mapping[str, SystemOutput]) -> dict[str, Signal]:
    """Digital signals of EIO.cfg by name; those of a system output mirror it.

    Raises RapidProgramError for an unknown status or signal, and for a task in an argument that is not a task's.
    """
    inputs = fragments.read("EIO")
    found = {each["Name"]: Signal(each["Name"], each["SignalType"]) for each in inputs.get("EIO_SIGNAL", [])}
    for output in inputs.get("SYSSIG_OUT", []):
        status, signal_name = output["Status"], output["Name" if fragments.robotware == 7 else "Signal"]
        if status not in outputs:
            raise RapidProgramError("EIO.cfg", 0, f"system output {status} is unknown: {', '.join(sorted(outputs))}")
        if signal_name not in found:
            raise RapidProgramError("EIO.cfg", 0, f"system output {status}: no signal is named {signal_name}")
        argument = TASK_ARGUMENTS.get(status)
        given = {key for key in output if key.startswith("Arg")}
        if given != ({argument} if argument else set()):
            raise RapidProgramError("EIO.cfg", 0, f"system output {status} takes {argument or 'no argument'}")
        found[signal_name].source = partial(outputs[status], output.get(argument or "", ""))
    return found


def egm_devices(fragments: Fragments) -> dict[str, int | None]:
    """Ports of the devices to which Externally Guided Motion can send, of SIO.cfg and egm/SIO.cfg.

    None: the mock's own sender sends for it (`--egm`).
    """
    found = [*fragments.read("egm/SIO").items(), *fragments.read("SIO").items()]
    transports = [each for kind, many in found if kind in ("COM_TRP", "UDPUC_HOST") for each in many]
    return {each["Name"]: fragments.egm_port(each) for each in transports if each.get("Type") == "UDPUC"}


def serial_ports(fragments: Fragments) -> tuple[str, ...]:
    """Names a program opens: "com1:" for the channel COM1."""
    return tuple(f"{port['Name'].casefold()}:" for port in fragments.read("SIO").get("COM_PHY_CHANNEL", []))
