"""Counters, and the text Prometheus reads (exposition format 0.0.4)."""

import os
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from daemon.runtime.version import VERSION
from registration.io.stream import CloudStream

Labels = tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Metric:
    """One family: its samples by labels."""

    name: str
    kind: str
    about: str
    samples: Mapping[Labels, float]

    def lines(self) -> Iterable[str]:
        yield f"# HELP {self.name} {self.about}"
        yield f"# TYPE {self.name} {self.kind}"
        for labels, value in self.samples.items():
            inside = ",".join(f'{key}="{_escaped(text)}"' for key, text in labels)
            yield f"{self.name}{{{inside}}} {_number(value)}" if inside else f"{self.name} {_number(value)}"


@dataclass(eq=False)
class Metrics:
    """What is counted while the daemon runs."""

    requests: Counter[tuple[str, int]] = field(default_factory=Counter)
    registered_points: int = 0
    registered_bytes: int = 0

    def registered(self, stream: CloudStream, answered_bytes: int) -> None:
        """A cloud passed whole."""
        self.registered_points += stream.points
        self.registered_bytes += answered_bytes

    def families(self) -> list[Metric]:
        # A counter that begins with its first error has no increase that an alert could see.
        counted = {("GET", 500): 0, ("POST", 500): 0, **self.requests}
        by_method: dict[Labels, float] = {
            (("method", method), ("status", str(code))): n for (method, code), n in counted.items()
        }
        return [
            Metric("handeyed_http_requests_total", "counter", "Requests answered.", by_method),
            Metric("handeyed_registered_points_total", "counter", "Points mapped by POST /register.",
                   {(): self.registered_points}),
            Metric("handeyed_registered_bytes_total", "counter", "Bytes answered by POST /register.",
                   {(): self.registered_bytes}),
            Metric("handeyed_build_info", "gauge", "Always 1; the version is a label.", {(("version", VERSION),): 1.0}),
            *process_families(),
        ]  # fmt: skip


def process_families(proc: Path = Path("/proc/self")) -> list[Metric]:
    """Memory and descriptors of this process, under the names every dashboard knows; nothing where /proc is not."""
    try:
        resident_pages = int((proc / "statm").read_text().split()[1])
        descriptors = sum(1 for _ in (proc / "fd").iterdir())
    except OSError:
        return []
    resident = resident_pages * os.sysconf("SC_PAGE_SIZE")
    return [
        Metric("process_resident_memory_bytes", "gauge", "Resident memory.", {(): float(resident)}),
        Metric("process_open_fds", "gauge", "Open file descriptors.", {(): float(descriptors)}),
    ]


def exposition(families: Iterable[Metric]) -> str:
    """The page for Prometheus."""
    return "".join(f"{line}\n" for family in families for line in family.lines())


def _escaped(text: str) -> str:
    return text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")


def _number(value: float) -> str:
    """Every digit of a counter: six would stand still for hours."""
    return str(int(value)) if value == int(value) else repr(float(value))
