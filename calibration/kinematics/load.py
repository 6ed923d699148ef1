"""What the flange carries."""

from dataclasses import dataclass
from math import dist

SAME_SHARE, SAME_MM = 0.1, 20.0
"""Within these of mass and of centre of mass two loads count as one. By one standard deviation of its compliance a
tenth of the largest load sags an IRB 2600 by 0.02 mm, an IRB 6700 by 0.1 mm."""


@dataclass(frozen=True)
class Load:
    """Mass, and centre of mass (3,) in the flange's frame, of all that the flange carries."""

    mass_kg: float = 0.0
    centre_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def is_as(self, other: "Load") -> bool:
        """Whether both weigh about the same at about the same place."""
        of_mass = SAME_SHARE * max(self.mass_kg, other.mass_kg)
        return abs(self.mass_kg - other.mass_kg) <= of_mass and dist(self.centre_mm, other.centre_mm) <= SAME_MM


NO_LOAD = Load()
