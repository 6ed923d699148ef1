"""Whether a cloud, in the unit that is stated for it, lies where a scanner on an arm can see anything."""

import numpy as np

from registration.errors import ScanError
from registration.points.layout import Layout, Records
from registration.points.rigid_motion import scale_to_mm

RangeMm = tuple[float, float]
POSSIBLE_MM: RangeMm = (1.0, 20_000.0)
"""No scanner sees a part nearer, and no arm with its scanner reaches as far."""
FIRST_POINTS = 512
"""Looked at first: one of them of a sound cloud mostly lies where one can, and the answer waits for no others."""
SLACK = 2.0
"""Scanners see somewhat nearer and farther than is stated for them."""
FIX = "check the unit that is stated, m or mm; force takes the cloud as it is"


def range_of(stated_mm: RangeMm | None, reach_mm: float | None = None) -> RangeMm:
    """Nearest and farthest at which a scanner can see a point, mm.

    By the two distances that are stated for it; otherwise an arm that carries it and works on the part has both within
    its reach, so no farther apart than twice of that. None: not known.
    """
    if stated_mm is not None:
        return min(stated_mm) / SLACK, max(stated_mm) * SLACK
    return POSSIBLE_MM if reach_mm is None else (POSSIBLE_MM[0], min(POSSIBLE_MM[1], 2 * reach_mm))


class RangeCheck:
    """Looks at blocks until a point lies within `range_mm` of the scanner, so that a sound cloud costs a few points."""

    def __init__(self, unit: str | None, range_mm: RangeMm = POSSIBLE_MM) -> None:
        """Raises UnitUnknown."""
        self._scale = scale_to_mm(unit)
        self._unit, self.range_mm = unit, range_mm
        self._near = self._far = False
        self.sound = False
        """Whether a point lies where one can be."""

    def look(self, block: Records, layout: Layout) -> None:
        """Take note of the distances of a block's points, which are in the scanner's frame."""
        nearest_mm, farthest_mm = self.range_mm
        for part in (block[:FIRST_POINTS], block[FIRST_POINTS:]):
            if self.sound:
                return
            seen = part[layout.has_point(part)]
            points = np.stack([seen[name].astype(float) for name in layout.xyz], axis=1)
            with np.errstate(over="ignore", invalid="ignore"):
                distances_mm = np.linalg.norm(points, axis=1) * self._scale
            self._near |= bool((distances_mm < nearest_mm).any())
            self._far |= bool((np.isfinite(distances_mm) & (distances_mm > farthest_mm)).any())
            self.sound = bool(((distances_mm >= nearest_mm) & (distances_mm <= farthest_mm)).any())

    @property
    def doubt(self) -> str | None:
        """Why the unit cannot be, as far as the blocks show; None of a cloud that may be, or without any point."""
        if self.sound or not (self._near or self._far):
            return None
        near, far = f"nearer than {self.range_mm[0]:g} mm", f"farther than {self.range_mm[1] / 1e3:g} m"
        where = " or ".join([near] * self._near + [far] * self._far)
        return f"every point is {where} from the scanner, with lengths in {self._unit}"

    def require(self, name: str) -> None:
        """Raises ScanError when the unit cannot be."""
        if (doubt := self.doubt) is not None:
            raise ScanError(f"{name}: {doubt}", FIX)
