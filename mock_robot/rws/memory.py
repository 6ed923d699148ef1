"""What RWS shows of RAPID and of the signals: data by name, modules by task, signals with their access level."""

import re
from collections.abc import Callable
from dataclasses import dataclass, field

from mock_robot.cabinet.cabinet import Cabinet

_MODULE = re.compile(rb"^\s*MODULE\s+(\w+)", re.IGNORECASE | re.MULTILINE)
TASKS = {"T_ROB1": True, "T_COMM": False}
"""The tasks, and whether they move the arm."""
LOAD0 = "[0.001,[0,0,0.001],[1,0,0,0],0,0,0]"
FRAME0 = "[[0,0,0],[1,0,0,0]]"


@dataclass
class Symbol:
    """A persistent of RAPID: its type and its value as RAPID writes it."""

    type: str
    value: str


@dataclass
class Signal:
    """`read` tells outputs of the system; they and inputs are written by nobody from outside."""

    type: str
    place: str
    written: bool
    value: float = 0
    read: Callable[[Cabinet], float] | None = None

    def lvalue(self, cabinet: Cabinet) -> str:
        """The logical value as text."""
        value = self.value if self.read is None else self.read(cabinet)
        return str(int(value)) if self.type != "AO" else f"{value:g}"


def _symbols() -> dict[str, Symbol]:
    return {
        "T_ROB1/BASE/tool0": Symbol("tooldata", f"[TRUE,{FRAME0},{LOAD0}]"),
        "T_ROB1/BASE/wobj0": Symbol("wobjdata", f'[FALSE,TRUE,"",{FRAME0},{FRAME0}]'),
        "T_ROB1/BASE/load0": Symbol("loaddata", LOAD0),
        **{f"T_ROB1/user/reg{number}": Symbol("num", "0") for number in range(1, 6)},
    }


def _signals() -> dict[str, Signal]:
    return {
        "cell_do_motors": Signal("DO", "", False, read=lambda cabinet: cabinet.panel.motors_on),
        "cell_do_estop": Signal("DO", "", False, read=lambda cabinet: cabinet.panel.emergency_stop),
        "cell_do_running": Signal("DO", "", False, read=lambda cabinet: cabinet.panel.program_running),
        "do_spare": Signal("DO", "Local/DRV_1", True),
        "di_part": Signal("DI", "Local/DRV_1", False),
    }


@dataclass
class Memory:
    """Loaded modules, symbols, signals. A bench may add its own."""

    symbols: dict[str, Symbol] = field(default_factory=_symbols)
    signals: dict[str, Signal] = field(default_factory=_signals)
    modules: dict[str, dict[str, str]] = field(
        default_factory=lambda: {task: {"BASE": "SysMod", "user": "SysMod"} for task in TASKS}
    )
    inactive: set[str] = field(default_factory=set)

    def symbol(self, path: str) -> tuple[str, Symbol] | None:
        """`T_ROB1/Module/name`, or `T_ROB1/name` when one module has it; the case does not matter."""
        wanted = path.strip("/").lower().split("/")
        for full, symbol in self.symbols.items():
            parts = full.lower().split("/")
            if parts == wanted or (len(wanted) == 2 and [parts[0], parts[-1]] == wanted):
                return full, symbol
        return None

    def signal(self, path: str) -> tuple[str, Signal] | None:
        """`name`, or `network/device/name`."""
        place, _, name = path.strip("/").rpartition("/")
        signal = self.signals.get(name)
        return None if signal is None or (place and place != signal.place) else (name, signal)


def module_name(content: bytes) -> str | None:
    """The name in a file's MODULE line."""
    found = _MODULE.search(content)
    return found.group(1).decode("latin-1") if found else None
