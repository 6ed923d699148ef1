"""What an arm's errors depend on beside its joints."""

from dataclasses import dataclass

from calibration.kinematics.load import Load


@dataclass(frozen=True)
class ArmConditions:
    """The load on the flange and the temperature of the arm's links; None for what is not known."""

    load: Load | None = None
    temperature_c: float | None = None


NOT_KNOWN = ArmConditions()
