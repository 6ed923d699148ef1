"""What the identification of an arm's own errors adds to the daemon."""

from functools import partial

from calibration.kinematics.arm import Arm
from daemon.api.extension import Extension
from daemon.runs.calibration_run import IdentifyArm
from daemon.runtime.version import SOFTWARE


def _load_identification(arm: Arm) -> IdentifyArm:
    from extensions.arm_identification.mathematics.documents import identify_with_findings

    return partial(identify_with_findings, arm, software=SOFTWARE)


ARM_IDENTIFICATION = Extension("arm_identification", identification=_load_identification)
