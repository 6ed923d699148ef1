"""What this cell knows of where the flange is, beside the pose that the controller reports."""

import time
from collections.abc import Callable

from calibration.documents.arm import ArmErrorsDocument
from calibration.documents.calibration import CalibrationDocument
from calibration.documents.calibration_in_use import CalibrationInUse
from calibration.documents.external_axis import ExternalAxisDocument
from calibration.kinematics.arm_conditions import ArmConditions
from calibration.kinematics.load import Load
from calibration.sentences.sentence import Sentence
from daemon.errors import CalibrationUnusable


class ArmInCell:
    """The external axis `declared` in the settings, their load, the reach of the arm where it is known and carries all
    sensors, and the temperature stated last, for `valid_s`.

    Every calibration that places a point in this cell is taken into use here.
    """

    def __init__(
        self,
        declared: ExternalAxisDocument | None = None,
        load: Load | None = None,
        valid_s: float = 0.0,
        monotonic_s: Callable[[], float] = time.monotonic,
        reach_mm: float | None = None,
    ) -> None:
        self.declared, self.reach_mm = declared, reach_mm
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

    def conditions(self) -> ArmConditions:
        """The load as set, and the temperature; None where it was not stated, or too long ago."""
        if self._stated is None or self.temperature_age_s is None:
            return ArmConditions(self._load)
        return ArmConditions(self._load, self._stated[0])

    def in_use(self, calibration: CalibrationDocument, errors: ArmErrorsDocument | None) -> CalibrationInUse:
        """The calibration with the errors of the arm that were identified with it, under the conditions of now.

        Raises CalibrationUnusable for one without the declared external axis, GeometryError.
        """
        if self.declared is not None and calibration.external_axis is None and calibration.setup == "eye-in-hand":
            axis = Sentence(f"axis-{self.declared.kind}")
            what = Sentence("made-without-axis", calibration=calibration.id, axis=axis)
            raise CalibrationUnusable(what, Sentence("calibrate-at-two-positions"))
        return CalibrationInUse.of(calibration, errors, self.conditions())
