"""Types and attributes of a controller's configuration files, as real controllers export them.

RobotWare 6: the union of EIO.cfg, SYS.cfg and SIO.cfg in the public repositories rpiRobotics/abb_motion_program_exec,
PaulaFreudenberger/ABB-Rapid-Git, rafurb886/ABB_EIO, tetov/compas_rcf, joseballester/abb-rapidserver,
panin-anan/abb_SAMXL_Grinding_RAPID, Keen1949/ABB_ROBOT_Socket, EdgarIvanMM/PaletizadoCajasConFrascos and
Fabio-Coder/Robo_ABB_Injetora-Rotinas_de_ajuste. RobotWare 7: what a GoFa with 7.20 lists over RWS, and the backups
beside it (eliasbitsch/MetaMove); zwj12/SignalAutoConfigurationTool writes a header without a layout.

An attribute that no export prints is refused: a real controller may know more.
"""

from collections.abc import Mapping
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

_SIGNAL = (
    "Name SignalType Device DeviceMap Label Category Access Default Size SafeLevel FiltPas FiltAct Invert EncType "
    "MaxLog MaxPhys MaxPhysLimit MaxBitVal MinLog MinPhys MinPhysLimit MinBitVal"
)
_TYPES = {
    ("EIO", "EIO_SIGNAL"): _SIGNAL,
    ("EIO", "EIO_CROSS"): "Name Res Act1 Oper1 Act2 Oper2 Act3 Oper3 Act4 Act1_invert Act4_invert",
    ("EIO", "EIO_ACCESS"): "Name Rapid LocalManual LocalAuto RemoteManual RemoteAuto",
    ("EIO", "SYSSIG_IN"): "Signal Action Arg1 Arg6 Arg7",
    ("EIO", "SYSSIG_OUT"): "Status Signal Arg1 Arg2",
    ("SYS", "CAB_TASKS"): (
        "Name Type MotionTask TrustLevel Entry BindRef RmqType Task_in_forground UseMechanicalUnitGroup"
    ),
    ("SYS", "CAB_TASK_MODULES"): "File ModName Task Shared AllTask AllMotionTask Hidden",
    ("SYS", "CAB_EXEC_HOOKS"): "Routine Shelf Task AllTask AllMotionTask",
    ("SIO", "COM_PHY_CHANNEL"): "Name Connector",
    ("SIO", "COM_TRP"): "Name Type PhyChannel RemoteAdress RemotePortNumber",
}
_TYPES_OF_7 = {
    ("SIO", "UDPUC_HOST"): "Name Type RemoteAddress RemotePortNumber LocalPortNumber",
    ("EIO", "SYSSIG_OUT"): "Status Name Arg1 Arg2 Arg3 Arg4 Arg5 Arg6 Arg7 Arg8",
    ("EIO", "SYSSIG_IN"): "Name Action Arg1 Arg2 Arg3 Arg4 Arg5 Arg6 Arg7 Arg8 Arg9 Arg10 Arg11",
    ("EIO", "EIO_CROSS"): (
        "Name Res Act1 Act1_invert Oper1 Act2 Act2_invert Oper2 Act3 Act3_invert Oper3 Act4 Act4_invert Oper4 Act5 "
        "Act5_invert"
    ),
    ("SYS", "CAB_TASKS"): (
        "Name Task_in_forground Type StackSize BindRef Entry Option TrustLevel RewERIfStop UseMechanicalUnitGroup "
        "MotionTask Hidden RmqType RmqMode RmqMaxMsgSize RmqMaxNoOfMsg ExcludeFromLoadModulesInAllTask"
    ),
    ("SYS", "CAB_TASK_MODULES"): "File ModName Task Install Txres Shared AllTask AllMotionTask Hidden",
    ("SYS", "CAB_EXEC_HOOKS"): "Routine Shelf Task AllTask AllMotionTask SeqNo",
}

TASK_ARGUMENTS: Mapping[str, str] = MappingProxyType({"TaskExecuting": "Arg2", "Error": "Arg2"})
"""The attribute in which a system output names its task. `Arg1` names a mechanical unit, as in MotSupTrigg."""

FACTORY_TASK = "T_ROB1"
"""The task every controller with one arm is delivered with: a fragment that declares it is a duplicate."""


def attributes_of(domain: str, kind: str, robotware: int) -> frozenset[str] | None:
    """Attributes of a type, or None for a type that no export has."""
    found = _TYPES.get((domain, kind))
    if robotware == 7:
        found = _TYPES_OF_7.get((domain, kind), found)
    return None if found is None else frozenset(found.split())


def signal_attribute(robotware: int) -> str:
    """The attribute in which a system output names its signal."""
    return "Name" if robotware == 7 else "Signal"
