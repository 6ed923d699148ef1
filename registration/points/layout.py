"""Layout of point records: columns, and which of them are coordinates and normals."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""Same as calibration.transforms.Array, without importing scipy (37 MB), which streaming does not need."""

Records = NDArray[Any]
"""A block of points, a one-dimensional structured array; valid until its producer makes the next one."""

Triple = tuple[str, str, str]

COLOURS: Triple = ("red", "green", "blue")

NORMALS: tuple[Triple, ...] = (("nx", "ny", "nz"), ("normal_x", "normal_y", "normal_z"))


@dataclass(frozen=True)
class Layout:
    """A packed record type. `normals`: columns that rotate with the cloud, None without any."""

    dtype: np.dtype[Any]
    xyz: Triple = ("x", "y", "z")
    normals: Triple | None = None

    @classmethod
    def of(cls, dtype: np.dtype[Any]) -> "Layout":
        """The layout of a record type with coordinates x, y, z. Raises KeyError when one is missing or not a
        single number.
        """
        numbers = {name for name in dtype.names or () if dtype[name].kind in "iuf"}
        for name in ("x", "y", "z"):
            if name not in numbers:
                raise KeyError(name)
        normals = next((names for names in NORMALS if set(names) <= numbers), None)
        return cls(dtype, ("x", "y", "z"), normals)

    @property
    def itemsize(self) -> int:
        return self.dtype.itemsize

    def kind(self, names: Triple) -> np.dtype[Any]:
        """Widest scalar type among three columns."""
        return np.result_type(*(self.dtype[name] for name in names))

    def is_contiguous(self, names: Triple) -> bool:
        """Whether the three columns are equal native floats side by side."""
        fields = [self.dtype.fields[name] for name in names] if self.dtype.fields else []
        first, size = fields[0][1], fields[0][0].itemsize
        return all(
            kind.kind == "f" and kind.isnative and kind == fields[0][0] and offset == first + index * size
            for index, (kind, offset, *_) in enumerate(fields)
        )

    def finite(self, block: Records) -> NDArray[np.bool_]:
        """Which points (n,) of a block have three finite coordinates."""
        x, y, z = (np.isfinite(block[name]) for name in self.xyz)
        finite: NDArray[np.bool_] = x & y & z
        return finite

    def has_point(self, block: Records) -> NDArray[np.bool_]:
        """Which points (n,) of a scanner's block are any: finite, and not 0, 0, 0 as in a pixel without one."""
        return np.asarray(self.finite(block) & np.any([block[name] != 0 for name in self.xyz], axis=0))

    def offset(self, name: str) -> int:
        assert self.dtype.fields is not None
        return int(self.dtype.fields[name][1])


def scalar_columns(dtype: np.dtype[Any]) -> np.dtype[Any]:
    """The same bytes with one column per number: fields of several elements are split."""
    columns: list[tuple[str, np.dtype[Any]]] = []
    for name in dtype.names or ():
        base, shape = dtype[name].subdtype or (dtype[name], ())
        columns += (
            [(f"{name}.{index}", base) for index in range(int(np.prod(shape, dtype=int)))] if shape else [(name, base)]
        )
    return np.dtype(columns)


XYZ_FLOAT32 = Layout.of(np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4")]))
XYZ_FLOAT64 = Layout.of(np.dtype([("x", "<f8"), ("y", "<f8"), ("z", "<f8")]))
