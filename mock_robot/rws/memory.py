"""RAPID data, modules and signals as RWS shows them: by name, by task, with access levels."""

import re
from collections.abc import Callable
from dataclasses import dataclass, field

from mock_robot.cabinet.cabinet import Cabinet, CabinetSymbol

_MODULE = re.compile(rb"^\s*MODULE\s+(\w+)", re.IGNORECASE | re.MULTILINE)
TASKS = {"T_ROB1": True, "T_HANDEYED": False}
"""The tasks of a controller that has the robot program, and whether each moves the arm."""
LOAD0 = "[0.001,[0,0,0.001],[1,0,0,0],0,0,0]"
FRAME0 = "[[0,0,0],[1,0,0,0]]"


@dataclass
class Symbol:
    """A RAPID persistent: its type, and its value in RAPID syntax."""

    type: str
    value: str


@dataclass
class RwsSignal:
    """A signal. `read` gives the value of a system output; those and inputs cannot be written from outside."""

    type: str
    place: str
    written: bool
    value: float = 0
    read: Callable[[Cabinet], float] | None = None

    def lvalue(self, cabinet: Cabinet) -> str:
        """Logical value as text."""
        value = self.value if self.read is None else self.read(cabinet)
        return str(int(value)) if self.type != "AO" else f"{value:g}"


def _symbols() -> dict[str, Symbol]:
    return {
        "T_ROB1/BASE/tool0": Symbol("tooldata", f"[TRUE,{FRAME0},{LOAD0}]"),
        "T_ROB1/BASE/wobj0": Symbol("wobjdata", f'[FALSE,TRUE,"",{FRAME0},{FRAME0}]'),
        "T_ROB1/BASE/load0": Symbol("loaddata", LOAD0),
        **{f"T_ROB1/user/reg{number}": Symbol("num", "0") for number in range(1, 6)},
    }


def _signals() -> dict[str, RwsSignal]:
    return {
        "cell_do_motors": RwsSignal("DO", "", False, read=lambda cabinet: cabinet.panel.motors_on),
        "cell_do_estop": RwsSignal("DO", "", False, read=lambda cabinet: cabinet.panel.emergency_stop),
        "cell_do_running": RwsSignal("DO", "", False, read=lambda cabinet: cabinet.panel.program_running),
        "do_spare": RwsSignal("DO", "Local/DRV_1", True),
        "di_part": RwsSignal("DI", "Local/DRV_1", False),
    }


@dataclass
class RwsMemory:
    """Loaded modules, symbols and signals. Tests may add their own."""

    symbols: dict[str, Symbol] = field(default_factory=_symbols)
    signals: dict[str, RwsSignal] = field(default_factory=_signals)
    modules: dict[str, dict[str, str]] = field(
        default_factory=lambda: {task: {"BASE": "SysMod", "user": "SysMod"} for task in TASKS}
    )
    inactive: set[str] = field(default_factory=set)
    tasks: dict[str, bool] = field(default_factory=lambda: dict(TASKS))

    def symbol(self, path: str, cabinet: Cabinet) -> tuple[str, CabinetSymbol] | None:
        """Find `T_ROB1/Module/name`, or `T_ROB1/name` when only one module has it; case-insensitive.

        What is not in `symbols` is looked for in the cabinet's program.
        """
        wanted = path.strip("/").lower().split("/")
        for full, symbol in self.symbols.items():
            parts = full.lower().split("/")
            if parts == wanted or (len(wanted) == 2 and [parts[0], parts[-1]] == wanted):
                return full, symbol
        task, module, name = [wanted[0], "", wanted[-1]] if len(wanted) == 2 else [*wanted, "", "", ""][:3]
        live = cabinet.symbol(task, module, name)
        return None if live is None else (path.strip("/"), live)


def module_name(content: bytes) -> str | None:
    """Name in a file's MODULE line."""
    found = _MODULE.search(content)
    return found.group(1).decode("latin-1") if found else None
