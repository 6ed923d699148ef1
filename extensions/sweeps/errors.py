"""Errors of sweeps."""

from daemon.errors import DaemonError


class NoProfiler(DaemonError, code="no-profiler"):
    """The scanner takes whole clouds, it is no line profiler."""

    status = 409

    def __init__(self, scanner: str) -> None:
        super().__init__(
            f"{scanner} takes whole clouds, it is no line profiler",
            "scan with POST /scans, or set a profiles: address for it",
        )


class NothingOnPath(DaemonError, code="nothing-on-path"):
    """No profile of a sweep lies on the robot's path: `left_out` of `profiles` lie before or after it."""

    status = 422

    def __init__(self, profiles: int, left_out: int) -> None:
        self.profiles, self.left_out = profiles, left_out
        empty, clock = "check that the part is within the sensor's range", "check the sensor's clock and clock_offset_s"
        what = f"{profiles - left_out} were taken on it and are empty, {left_out} before or after it"
        super().__init__(
            f"of {profiles} profiles no point lies on the robot's path: {what}",
            f"{empty}, then {clock[6:]}" if 2 * left_out < profiles else f"{clock}, then {empty[6:]}",
        )


class SweepTooLong(DaemonError, code="sweep-too-long"):
    """A sweep was not ended within `limit_s`."""

    status = 409

    def __init__(self, limit_s: float) -> None:
        self.limit_s = limit_s
        super().__init__(f"the sweep was not ended in {limit_s:g} s", "end each sweep with POST /sweeps/{id}/end")
