"""Columns under the Point Cloud Library's names and types, so that its readers and Open3D find them in a PCD."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from registration.errors import CloudUnsupported
from registration.points.layout import Layout, Records
from registration.points.rigid_motion import FLOAT32_REACH_MM

NAMES = {"nx": "normal_x", "ny": "normal_y", "nz": "normal_z"}

SHIFTS = {"red": 16, "green": 8, "blue": 0}
"""Bit offset of each colour in the packed 0x00RRGGBB, stored under the name `rgb` as the bits of a float."""

SINGLE = {"x", "y", "z", "nx", "ny", "nz"}
"""Columns that PCL and Open3D read only as single floats."""


def _reach(column: NDArray[Any]) -> float:
    """Largest finite magnitude."""
    return float(np.abs(column, where=np.isfinite(column), out=np.zeros(len(column))).max(initial=0.0))


def unpack_colour(name: str, colour: str, block: Records | Mapping[str, NDArray[Any]]) -> NDArray[np.uint8]:
    """One colour of the packed column `name` of four bytes each."""
    bits = np.ascontiguousarray(block[name]).view(np.uint32)
    return (bits >> np.uint32(SHIFTS[colour])).astype(np.uint8)


@dataclass(frozen=True)
class PclRecords:
    """Converts blocks of common columns to PCL's: normals renamed, three 8-bit colours packed into one field."""

    common: Layout
    file: str

    @cached_property
    def layout(self) -> Layout:
        """PCL's columns."""
        kinds = {name: self.common.dtype[name] for name in self.common.dtype.names or ()}
        packs = all(kinds.get(colour) == np.uint8 for colour in SHIFTS)
        columns: list[tuple[str, Any]] = []
        for name, kind in kinds.items():
            if packs and name == "red":
                columns.append(("rgb", "<f4"))
            elif not (packs and name in SHIFTS):
                columns.append((NAMES.get(name, name), np.dtype(np.float32) if name in SINGLE else kind))
        return Layout.of(np.dtype(columns))

    def encode(self, block: Records) -> memoryview:
        """The bytes to write. Raises CloudUnsupported where single floats would lose digits of doubles."""
        if any(block.dtype[name].itemsize > 4 and _reach(block[name]) > FLOAT32_REACH_MM for name in ("x", "y", "z")):
            what = f"coordinates beyond {FLOAT32_REACH_MM:.0f} mm lose digits in a PCD's single floats"
            raise CloudUnsupported(self.file, "points", what, "write a PLY instead")
        renamed = {new: old for old, new in NAMES.items()}
        out = np.empty(len(block), self.layout.dtype)
        for name in self.layout.dtype.names or ():
            if name == "rgb" and "rgb" not in (block.dtype.names or ()):
                packed = sum(block[colour].astype(np.uint32) << np.uint32(by) for colour, by in SHIFTS.items())
                out[name] = np.asarray(packed, np.uint32).view(np.float32)
            else:
                out[name] = block[renamed.get(name, name)]
        return out.view(np.uint8).data
