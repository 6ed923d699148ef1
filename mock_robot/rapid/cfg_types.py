"""Types and attributes of a controller's configuration files, as real controllers export them.

RobotWare 6: the union of EIO.cfg, SYS.cfg and SIO.cfg in the public repositories rpiRobotics/abb_motion_program_exec,
PaulaFreudenberger/ABB-Rapid-Git, rafurb886/ABB_EIO, tetov/compas_rcf, joseballester/abb-rapidserver,
panin-anan/abb_SAMXL_Grinding_RAPID, Keen1949/ABB_ROBOT_Socket, EdgarIvanMM/PaletizadoCajasConFrascos and
Fabio-Coder/Robo_ABB_Injetora-Rotinas_de_ajuste. RobotWare 7: what a GoFa with 7.20 lists over RWS, and the backups
beside it (eliasbitsch/MetaMove); zwj12/SignalAutoConfigurationTool writes a header without a layout.

An attribute that no export prints is refused: a real controller may know more.
"""

import json
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

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


def signal_attribute(robotware: int) -> str:
    """The attribute in which a system output names its signal."""
    return "Name" if robotware == 7 else "Signal"
