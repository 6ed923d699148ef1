"""`python -m tests.protocols.register_docs`: write docs/plc-registers.csv, and the tables of docs/plc.md."""

import csv
from collections.abc import Iterable
from enum import IntFlag
from io import StringIO
from pathlib import Path

from protocols.plc.codes import ERROR_CODES, UNKNOWN, ContentsBit, ControlBit, StatusBit
from protocols.plc.registers import REGISTERS, RESULT, STATUS, Register

DOCS = Path(__file__).resolve().parents[2] / "docs"
BEGIN, END = "<!-- tables: written by python -m tests.protocols.register_docs -->\n\n", "\n<!-- end of the tables -->"

BITS: dict[str, type[IntFlag]] = {"control": ControlBit, "status": StatusBit, "contents": ContentsBit}

BIT_MEANINGS: dict[tuple[type[IntFlag], int], str] = {
    (ControlBit, ControlBit.TRIGGER_CALIBRATE): "rising edge: calibrate",
    (ControlBit, ControlBit.TRIGGER_VERIFY): "rising edge: verify the active calibration",
    (ControlBit, ControlBit.TRIGGER_REGISTER): "rising edge: scan the part from the taught poses and register it",
    (
        ControlBit,
        ControlBit.RESULTS_ACK,
    ): "rising edge: the result has been read, and the next trigger may come; its result is shown when this is low",
    (
        ControlBit,
        ControlBit.ABORT,
    ): "rising edge: stop the run in progress, whoever started it; while it is set, nobody starts one",
    (ControlBit, ControlBit.CLEAR_ERROR): "rising edge: clear error and missed_trigger",
    (StatusBit, StatusBit.READY): "a trigger that rises now would be accepted",
    (
        StatusBit,
        StatusBit.TRIGGER_ACK,
    ): "the trigger was answered: begun, or refused with error; falls with the trigger",
    (StatusBit, StatusBit.CALIBRATION_IN_FORCE): "verify and register can be done",
    (StatusBit, StatusBit.MISSED_TRIGGER): "a trigger rose while a command was in progress; it was ignored",
    (
        StatusBit,
        StatusBit.DRIFT_ALARM,
    ): "the quick checks show that the calibration no longer holds: calibrate again",
    (StatusBit, StatusBit.MOTION_ALLOWED): "[plc] motion = true: triggers may move the arm",
    (
        StatusBit,
        StatusBit.PLC_SILENT,
    ): "heartbeat_in has stopped: triggers are refused, and a command in progress is stopped",
    (StatusBit, StatusBit.ONLINE): "the daemon has read the cell's state; all other bits are valid",
    (StatusBit, StatusBit.BUSY): "a command of the PLC is in progress",
    (
        StatusBit,
        StatusBit.COMPLETED,
    ): "the last command has ended, well or not; falls with the next trigger that is begun",
    (
        StatusBit,
        StatusBit.BUFFER_OVERRUN,
    ): "always 0: no command is begun before the last result was acknowledged, so that none is lost",
    (StatusBit, StatusBit.RESULTS_VALID): "the result block is complete and stays as it is until it is acknowledged",
    (
        StatusBit,
        StatusBit.STOP_UNCONFIRMED,
    ): "the controller has not confirmed that the arm stands and that motion is switched off: press the emergency stop",
    (StatusBit, StatusBit.ERROR): "error_code says why; cleared by clear_error or by the next trigger that is begun",
    (ContentsBit, ContentsBit.X): "x, q and their integers",
    (ContentsBit, ContentsBit.UNCERTAINTY): "sigma, sigma_r, sigma_point and their integers",
    (ContentsBit, ContentsBit.DEVIATION): "deviation and its integer",
    (ContentsBit, ContentsBit.WORST_POINT): "u_worst and its integer, worst_point",
    (ContentsBit, ContentsBit.TOLERANCE): "tolerance and its integer",
    (ContentsBit, ContentsBit.TOLERANCE_STATED): "the tolerance was stated by settings, PLC or request; else it is the"
    " default of 1 mm",
    (ContentsBit, ContentsBit.EXPECTED): "u_expected and its integer",
    (ContentsBit, ContentsBit.BEFORE): "u_before and its integer",
    (ContentsBit, ContentsBit.UNEXPECTED): "u_worst is more than 1.5 times u_expected, or less than that",
    (ContentsBit, ContentsBit.IN_FORCE): "the result's calibration is active; low after an accepted calibrate: it"
    " waits for a person",
}


def csv_text() -> str:
    """One line per register and one per bit."""
    out = StringIO()
    table = csv.writer(out, lineterminator="\n")
    table.writerow(
        ["block", "address", "reference", "coil_or_input", "name", "type", "registers", "access", "unit", "meaning"]
    )
    for register in REGISTERS:
        access = "read/write" if register.writable else "read"
        table.writerow([block_of(register), register.address, 400001 + register.address, "", register.name,
                        register.kind, register.registers, access, register.unit, register.meaning])  # fmt: skip
        for bit in BITS.get(register.name, ()):
            number = bit.value.bit_length() - 1
            coil = number if register.name in ("control", "status") else ""
            name = f"{register.name}.{bit_name(bit)}"
            table.writerow([block_of(register), f"{register.address}.{number}", "", coil, name, "bit", "", access, "",
                            BIT_MEANINGS[type(bit), bit]])  # fmt: skip
    return out.getvalue()


def markdown_text() -> str:
    """Tables of registers by block, bits, numbers and error codes."""
    parts: list[str] = []
    for block in ("control", "status", "result"):
        rows = [(_places(r), f"`{r.name}`", str(r.kind), r.unit, r.meaning) for r in REGISTERS if block_of(r) == block]
        parts += [f"### {block.capitalize()}", _table(("address", "name", "type", "unit", "meaning"), rows)]
    for name, bits in BITS.items():
        lines = [(str(bit.value.bit_length() - 1), f"`{bit_name(bit)}`", BIT_MEANINGS[type(bit), bit]) for bit in bits]
        parts += [f"### Bits of `{name}`", _table(("bit", "name", "meaning"), lines)]
    codes = sorted({(number, meaning) for number, meaning in ERROR_CODES.values()})
    errors = [*codes, (UNKNOWN, "an error without a number: the log has its words")]
    parts += ["### Error codes", _table(("code", "meaning"), [(str(number), meaning) for number, meaning in errors])]
    return "\n\n".join(parts) + "\n"


def block_of(register: Register) -> str:
    """Block of a register: control, status or result."""
    return "control" if register.address < STATUS else "status" if register.address < RESULT else "result"


def bit_name(bit: IntFlag) -> str:
    """Name of a bit as in the tables and the text."""
    return (bit.name or "").lower()


def _places(register: Register) -> str:
    last = register.addresses[-1]
    return str(register.address) if last == register.address else f"{register.address}–{last}"


def _table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    lines = [head, tuple("---" for _ in head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def main() -> None:
    """Write both files in this repository."""
    page = DOCS / "plc.md"
    head, _, rest = page.read_text(encoding="utf-8").partition(BEGIN)
    tail = rest.partition(END)[2]
    page.write_text(head + BEGIN + markdown_text() + END + tail, encoding="utf-8")
    (DOCS / "plc-registers.csv").write_text(csv_text(), encoding="utf-8")


if __name__ == "__main__":
    main()
