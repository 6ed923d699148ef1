"""Counters, and the text Prometheus reads (exposition format 0.0.4)."""

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from registration.stream import CloudStream

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
        by_method: dict[Labels, float] = {
            (("method", method), ("status", str(code))): n for (method, code), n in self.requests.items()
        }
        return [
            Metric("handeyed_http_requests_total", "counter", "Requests answered.", by_method),
            Metric("handeyed_registered_points_total", "counter", "Points mapped by POST /register.",
                   {(): self.registered_points}),
            Metric("handeyed_registered_bytes_total", "counter", "Bytes answered by POST /register.",
                   {(): self.registered_bytes}),
        ]  # fmt: skip


def exposition(families: Iterable[Metric]) -> str:
    """The page for Prometheus."""
    return "".join(f"{line}\n" for family in families for line in family.lines())


def _escaped(text: str) -> str:
    return text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")


def _number(value: float) -> str:
    """Every digit of a counter: six would stand still for hours."""
    return str(int(value)) if value == int(value) else repr(float(value))
