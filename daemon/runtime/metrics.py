"""Counters, and their text in the Prometheus exposition format 0.0.4."""

import os
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from daemon.runtime.version import VERSION
from registration.io.stream import CloudStream

Labels = tuple[tuple[str, str], ...]
ESCAPES = str.maketrans({"\\": r"\\", '"': r"\"", "\n": r"\n"})


@dataclass(frozen=True)
class Metric:
    """One metric family: name, type, help text and samples by labels."""

    name: str
    kind: str
    about: str
    samples: Mapping[Labels, float]

    def lines(self) -> Iterable[str]:
        yield f"# HELP {self.name} {self.about}"
        yield f"# TYPE {self.name} {self.kind}"
        for labels, value in self.samples.items():
            inside = ",".join(f'{key}="{text.translate(ESCAPES)}"' for key, text in labels)
            yield f"{self.name}{{{inside}}} {_number(value)}" if inside else f"{self.name} {_number(value)}"


def merged(families: Iterable[Metric]) -> list[Metric]:
    """The families, each name once, with the samples of all of that name."""
    found: dict[str, Metric] = {}
    for family in families:
        before = found.get(family.name, family).samples
        found[family.name] = replace(family, samples={**before, **family.samples})
    return list(found.values())


@dataclass(eq=False)
class Metrics:
    """Counters since the daemon started."""

    requests: Counter[tuple[str, int]] = field(default_factory=Counter)
    registered_points: int = 0
    registered_bytes: int = 0

    def count_cloud(self, stream: CloudStream, answer_bytes: int) -> None:
        """Count one cloud registered by POST /register: its points and the bytes of the answer."""
        self.registered_points += stream.points
        self.registered_bytes += answer_bytes

    def families(self) -> list[Metric]:
        """The families of GET /metrics that belong to no service."""
        # The 500 counters start at 0: Prometheus sees no increase in a series that first appears with its first error.
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
    """Resident memory and open descriptors of this process under Prometheus' standard names; empty without /proc."""
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


def _number(value: float) -> str:
    """A value with all its digits: rounded to six, a large counter would appear constant for hours."""
    return str(int(value)) if value == int(value) else repr(float(value))
