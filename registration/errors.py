"""Errors of registration. A cloud's error names file and place, what is wrong and how to fix it.

RegistrationError
├── CloudError             an error of one cloud, with `file` and `place`
│   ├── CloudFormatError       the bytes violate the format or the header
│   ├── CloudTruncated         the bytes end too early
│   ├── CloudTooLong           bytes follow after the cloud's end
│   ├── CloudUnsupported       a valid cloud that is not supported, or whose extra is not installed
│   └── CloudIOError           the operating system could not read or write (disk full, no such file)
├── UnitUnknown            it is not stated whether coordinates are metres or millimetres
├── MotionError            a transform is not a rigid motion (mirrored, scaled, not finite)
├── MergeStopped           nobody waits for the merged cloud any more
├── ScanError              views that cannot be registered together
├── ProfileError           profiles of a laser line that cannot be used
├── PathError              times and poses that are not the path of a robot
├── PathTooCoarse          the arm moves too fast, or too unevenly, for the poses of its path
├── PathGap                a profile was taken where the robot's poses are missing
└── SphereError            the points are not a sphere of the stated radius
"""

from calibration.errors import ErrorWithFix


class RegistrationError(ErrorWithFix, code="registration-error"):
    """Root of registration's errors. `code` is stable; `what` and `fix` are for people."""


class CloudError(RegistrationError, code="cloud-error"):
    """An error of one cloud. `file` names it ('request body' for an upload), `place` a position in it."""

    def __init__(self, file: str, place: str, what: str, fix: str) -> None:
        super().__init__(what, fix)
        self.file, self.place = file, place
        self.args = (f"{file}: {place}: {what}: {fix}",)


class CloudFormatError(CloudError, code="cloud-malformed"):
    """The bytes violate the format or the header."""


class CloudTruncated(CloudError, code="cloud-truncated"):
    """The bytes end too early."""


class CloudTooLong(CloudError, code="cloud-too-long"):
    """Bytes follow after the cloud's end."""


class CloudUnsupported(CloudError, code="cloud-unsupported"):
    """A valid cloud that is not supported here, or whose optional library is not installed."""


class CloudIOError(CloudError, code="cloud-io"):
    """The operating system could not read or write the file."""


class UnitUnknown(RegistrationError, code="unit-unknown"):
    """It is not stated whether coordinates are metres or millimetres; the unit is never guessed."""


class MotionError(RegistrationError, code="not-a-motion"):
    """A transform is not a rigid motion."""


class MergeStopped(RegistrationError, code="merge-stopped"):
    """Nobody waits for the merged cloud any more."""

    def __init__(self) -> None:
        super().__init__("the merge was stopped", "ask for the cloud again")


class ScanError(RegistrationError, code="scan-unusable"):
    """Views that cannot be registered together."""


class ProfileError(RegistrationError, code="profiles-unusable"):
    """Profiles of a laser line that cannot be used."""


class PathError(RegistrationError, code="path-unusable"):
    """Times and poses that are not the path of a robot."""


class PathTooCoarse(RegistrationError, code="path-too-coarse"):
    """The arm moves too fast, or too unevenly, for the poses around it."""

    def __init__(self, time_s: float, bend_mm: float, max_bend_mm: float) -> None:
        super().__init__(
            f"at {time_s:.4f} s the sensor leaves the line between two poses by {bend_mm:.2f} mm, more than"
            f" {max_bend_mm:g} mm",
            "sweep more slowly, or have the robot's poses more often ([robot.egm])",
        )


class PathGap(RegistrationError, code="path-gap"):
    """A profile was taken where the robot's poses are missing.

    `time_s` of the robot's clock lies `gap_s` outside the path (`outside`), or between poses that are `gap_s` apart.
    """

    def __init__(self, time_s: float, gap_s: float, max_gap_s: float, *, outside: bool) -> None:
        self.time_s, self.gap_s, self.outside = time_s, gap_s, outside
        where = "outside the robot's path by" if outside else "between two poses of the robot that are apart by"
        super().__init__(
            f"a profile at {time_s:.4f} s of the robot's clock lies {where} {gap_s:.4f} s, more than {max_gap_s:g} s",
            "record poses without pauses from before the first to after the last profile, and check the clock offset",
        )


class SphereError(RegistrationError, code="not-the-sphere"):
    """The points are not a sphere of the stated radius."""
