"""What is known now of the arm's load and temperature."""

from collections.abc import Callable

from calibration.kinematics.arm_conditions import ArmConditions
from calibration.kinematics.load import Load


class ArmConditionsNow:
    """The load of the settings, and the temperature that was stated last, for `valid_s`.

    Every calibration, scan and drift chart of the cell reads them here.
    """

    def __init__(self, load: Load | None, valid_s: float, monotonic_s: Callable[[], float]) -> None:
        self._load, self._valid_s, self._monotonic_s = load, valid_s, monotonic_s
        self._stated: tuple[float, float] | None = None

    def state_temperature(self, temperature_c: float) -> None:
        """Take this for the temperature of the arm's links from now on."""
        self._stated = temperature_c, self._monotonic_s()

    @property
    def temperature_age_s(self) -> float | None:
        """Seconds since it was stated; None where it is not known."""
        if self._stated is None:
            return None
        age_s = self._monotonic_s() - self._stated[1]
        return age_s if age_s <= self._valid_s else None

    def read(self) -> ArmConditions:
        """The load as set, and the temperature; None where it was not stated, or too long ago."""
        if self._stated is None or self.temperature_age_s is None:
            return ArmConditions(self._load)
        return ArmConditions(self._load, self._stated[0])
