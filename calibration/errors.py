"""Errors of the calibration room.

CalibrationError
├── DocumentError          a JSON or TOML document is not what it should be
├── DetectionError         the target was not found, or what was found is not the target
├── GeometryError          a number is not what the mathematics needs (not a rotation, not finite)
└── UndeterminedError      the motions cannot determine X; there is no transform to give
"""

from dataclasses import dataclass
from typing import Any


class Portable(Exception):
    """An error that may be told in another process than it happened in, whatever its constructor takes."""

    def __reduce__(self) -> tuple[Any, ...]:
        return _again, (type(self), self.args, self.__dict__)


def _again(kind: type[Portable], arguments: tuple[Any, ...], data: dict[str, Any]) -> Portable:
    error = kind.__new__(kind)
    error.args = arguments
    error.__dict__.update(data)
    return error


class CalibrationError(Portable):
    """Root of the room's errors."""


@dataclass(frozen=True)
class DocumentProblem:
    """One thing wrong with a document: where it stands, what is wrong, what to do."""

    place: str
    what: str
    fix: str

    def __str__(self) -> str:
        return f"{self.place}: {self.what}: {self.fix}"


class DocumentError(CalibrationError):
    """A document cannot be used. `origin` is the file (or 'request body'); each problem says place, what and fix."""

    def __init__(self, origin: str, problems: list[DocumentProblem]) -> None:
        self.origin = origin
        self.problems = problems
        super().__init__("\n".join(f"{origin}: {problem}" for problem in problems))


class DetectionError(CalibrationError):
    """The target was not found in an image. `code` is stable, `what` and `fix` are for people."""

    def __init__(self, code: str, what: str, fix: str) -> None:
        self.code, self.what, self.fix = code, what, fix
        super().__init__(f"{what}: {fix}")


class GeometryError(CalibrationError):
    """A number is not what the mathematics needs."""


class UndeterminedError(CalibrationError):
    """The motions cannot determine X. `code` names why, `what` and `fix` are for people."""

    def __init__(self, code: str, what: str, fix: str) -> None:
        self.code, self.what, self.fix = code, what, fix
        super().__init__(f"{what}: {fix}")
