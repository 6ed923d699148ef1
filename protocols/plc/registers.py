"""The register map of registers.csv. docs/plc.md and docs/plc-registers.csv are generated from it.

One address space for functions 3 and 4. Coil n is bit n of register 0, discrete input n is bit n of register 16.
"""

import csv
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

CONTROL, STATUS, RESULT = 0, 16, 64
"""First address of each block."""


class Kind(StrEnum):
    """Encoding of a value in its registers."""

    BITS = "bits"
    UINT16 = "uint16"
    INT32 = "int32"
    UINT32 = "uint32"
    FLOAT32 = "float32"
    TEXT24 = "text24"


REGISTERS_OF: dict[Kind, int] = {
    Kind.BITS: 1, Kind.UINT16: 1, Kind.INT32: 2, Kind.UINT32: 2, Kind.FLOAT32: 2, Kind.TEXT24: 12
}  # fmt: skip


@dataclass(frozen=True)
class Register:
    """One named value. `writable`: the PLC may write it."""

    address: int
    name: str
    kind: Kind
    unit: str
    meaning: str
    writable: bool = False

    @property
    def registers(self) -> int:
        return REGISTERS_OF[self.kind]

    @property
    def addresses(self) -> range:
        return range(self.address, self.address + self.registers)


with (Path(__file__).parent / "registers.csv").open(encoding="utf-8") as table:
    REGISTERS: tuple[Register, ...] = tuple(
        Register(
            int(row["address"]), row["name"], Kind(row["kind"]), row["unit"], row["meaning"], bool(row["writable"])
        )
        for row in csv.DictReader(table)
    )

SIZE = REGISTERS[-1].address + REGISTERS[-1].registers
"""Addresses 0 to SIZE - 1 can be read; unnamed ones read 0."""

BY_NAME: dict[str, Register] = {register.name: register for register in REGISTERS}

WRITABLE: frozenset[int] = frozenset(
    address for register in REGISTERS if register.writable for address in register.addresses
)
"""Addresses the PLC may write."""
