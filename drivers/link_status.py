"""Connection status of a device, kept by its driver."""

from collections.abc import Callable

from drivers.interfaces import LinkHealth


class LinkReport:
    """The newest LinkHealth. `since_s` changes only with `connected`, not with each new sentence."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self.health = LinkHealth(False, "not connected yet", clock())

    def up(self, detail: str) -> None:
        self._set(True, detail)

    def down(self, detail: str) -> None:
        self._set(False, detail)

    def _set(self, connected: bool, detail: str) -> None:
        since_s = self._clock() if connected != self.health.connected else self.health.since_s
        self.health = LinkHealth(connected, detail, since_s)
