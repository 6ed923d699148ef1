"""Places the stamps of a device's clock on this machine's clock, by what arrives."""

WINDOW_S = 10.0
"""Clocks that run apart by 50 millionths differ by half a millisecond after it."""


class ClockMapping:
    """This machine's clock minus the device's: the least delay of the last 10 to 20 s.

    What is stamped and sent arrives later, never earlier: of many delays the least is nearest to the true offset.
    """

    def __init__(self) -> None:
        self._begun_at_s = self._stamp_s = -float("inf")
        self._before_s = self._least_s = float("inf")

    @property
    def offset_s(self) -> float:
        """Infinite before the first stamp."""
        return min(self._before_s, self._least_s)

    def note(self, stamp_s: float, received_at_s: float) -> None:
        """A stamp, and when it arrived here. One before its predecessor is of a clock that was set: begin anew."""
        if stamp_s < self._stamp_s:
            self._before_s = self._least_s = float("inf")
        elif received_at_s - self._begun_at_s > WINDOW_S:
            self._begun_at_s, self._before_s, self._least_s = received_at_s, self._least_s, float("inf")
        self._stamp_s, self._least_s = stamp_s, min(self._least_s, received_at_s - stamp_s)
