"""How often systemd has started the service again since somebody started it, and why: ExecStopPost= writes each end."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from calibration.sentences.sentence import Sentence
from daemon.runtime.bounded_read import read_bounded
from daemon.runtime.metrics import Labels, Metric

ENDS = "ends"
"""In the runtime folder, which systemd keeps until the next start after a failure, and deletes when it is stopped."""

RECENT_S = 24 * 3600.0
"""An end is warned of for so long."""


@dataclass(frozen=True)
class ServiceEnd:
    """One end that nobody asked for: when, in seconds since 1970, and its cause in systemd's words."""

    at_s: float
    cause: str


def read_ends(folder: Path | None) -> tuple[ServiceEnd, ...]:
    """Ends that nobody asked for, oldest first; empty for a daemon that is no service."""
    if folder is None:
        return ()
    try:
        lines = read_bounded(folder / ENDS).decode("ascii", "replace").splitlines()
    except OSError:
        return ()
    ends = (_parse(line) for line in lines)
    return tuple(end for end in ends if end is not None)


def _parse(line: str) -> ServiceEnd | None:
    """An end of "1795680000 watchdog killed ABRT"; None for one that was asked for."""
    at, result, code, status, *_ = [*line.split(), "", "", "", ""]
    if not at.isdigit() or result in ("", "success"):
        return None
    detail = {"exit-code": f"exit status {status}", "signal": f"signal {status}", "core-dump": f"signal {status}"}
    return ServiceEnd(float(at), detail.get(result, result) if code else result)


@dataclass(frozen=True)
class ServiceEnds:
    """What /ready and /metrics say of the ends. `now_s`: seconds since 1970."""

    ends: tuple[ServiceEnd, ...]
    now_s: Callable[[], float] = lambda: datetime.now(UTC).timestamp()

    def warnings(self) -> list[str]:
        """The last end, while it is recent."""
        if not self.ends or self.now_s() - self.ends[-1].at_s > RECENT_S:
            return []
        last = self.ends[-1]
        at = datetime.fromtimestamp(last.at_s, UTC).strftime("%Y-%m-%d %H:%M:%S UTC")
        return [Sentence("service-restarted", count=len(self.ends), cause=last.cause, at=at)]

    def families(self) -> Iterable[Metric]:
        """The number of ends by cause."""
        causes = [end.cause for end in self.ends]
        samples: dict[Labels, float] = {
            (("cause", cause),): float(causes.count(cause)) for cause in sorted(set(causes))
        }
        about = "Starts of the service after ends that nobody asked for, since somebody started it, by cause."
        return [Metric("handeyed_service_restarts_total", "counter", about, samples or {(("cause", "none"),): 0.0})]
