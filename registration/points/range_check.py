"""Whether a cloud, in the unit that is stated for it, lies where a scanner on an arm can see anything."""

import numpy as np

from registration.errors import ScanError
from registration.points.layout import Layout, Records
from registration.points.rigid_motion import scale_to_mm

NEAREST_MM, FARTHEST_MM = 1.0, 20_000.0
"""No scanner sees a part nearer, and no arm with its scanner reaches as far."""
FIX = "check the unit that is stated, m or mm; force takes the cloud as it is"


class RangeCheck:
    """Looks at blocks until a point lies between NEAREST_MM and FARTHEST_MM, so that a sound cloud costs one block."""

    def __init__(self, unit: str | None) -> None:
        """Raises UnitUnknown."""
        self._scale = scale_to_mm(unit)
        self._unit = unit
        self._near = self._far = False
        self.sound = False
        """Whether a point lies where one can be."""

    def look(self, block: Records, layout: Layout) -> None:
        """Take note of the distances of a block's points, which are in the scanner's frame."""
        if self.sound:
            return
        points = np.stack([block[name].astype(float) for name in layout.xyz], axis=1)
        with np.errstate(over="ignore", invalid="ignore"):
            distances_mm = np.linalg.norm(points, axis=1) * self._scale
        self._near |= bool((distances_mm < NEAREST_MM).any())
        self._far |= bool((np.isfinite(distances_mm) & (distances_mm > FARTHEST_MM)).any())
        self.sound = bool(((distances_mm >= NEAREST_MM) & (distances_mm <= FARTHEST_MM)).any())

    @property
    def doubt(self) -> str | None:
        """Why the unit cannot be, as far as the blocks show; None of a cloud that may be, or without any point."""
        if self.sound or not (self._near or self._far):
            return None
        near, far = f"nearer than {NEAREST_MM:g} mm", f"farther than {FARTHEST_MM / 1e3:g} m"
        where = " or ".join([near] * self._near + [far] * self._far)
        return f"every point is {where} from the scanner, with lengths in {self._unit}"

    def require(self, name: str) -> None:
        """Raises ScanError when the unit cannot be."""
        if (doubt := self.doubt) is not None:
            raise ScanError(f"{name}: {doubt}", FIX)
