"""Errors of the calibration package.

CalibrationError
├── DocumentError          a JSON or TOML document is not valid
├── DetectionError         the target was not found, or what was found is not the target
├── GeometryError          a number is outside a function's domain (not a rotation, not finite)
├── UndeterminedError      the motions do not determine X, so there is no transform to return
├── ComparisonError        two calibrations cannot be compared
└── ExportRefused          there is nothing to export, or not in this way
"""

from dataclasses import dataclass
from typing import Any, ClassVar, Self


class PicklableError(Exception):
    """An exception that can be pickled, and so cross processes, whatever arguments its constructor takes."""

    def __reduce__(self) -> tuple[Any, ...]:
        return _rebuild, (type(self), self.args, self.__dict__)


def _rebuild(kind: type[PicklableError], arguments: tuple[Any, ...], data: dict[str, Any]) -> PicklableError:
    error = kind.__new__(kind)
    error.args = arguments
    error.__dict__.update(data)
    return error


class CodedError(Exception):
    """An error whose class states a stable `code`; a class that states none has its base's."""

    code: ClassVar[str]

    def __init_subclass__(cls, code: str | None = None) -> None:
        super().__init_subclass__()
        if code is not None:
            cls.code = code


class ErrorWithFix(CodedError, PicklableError):
    """`what` and `fix` are sentences for people."""

    def __init__(self, what: str, fix: str) -> None:
        self.what, self.fix = what, fix
        super().__init__(f"{what}: {fix}")


class CalibrationError(PicklableError):
    """Base of all errors of this package."""


@dataclass(frozen=True)
class DocumentProblem:
    """One defect of a document: its place, what is wrong, and how to fix it."""

    place: str
    what: str
    fix: str

    def __str__(self) -> str:
        return f"{self.place}: {self.what}: {self.fix}"


class DocumentError(CalibrationError):
    """A document cannot be used. `origin`: the file (or 'request body'); `problems`: every defect found."""

    def __init__(self, origin: str, problems: list[DocumentProblem]) -> None:
        self.origin, self.problems = origin, problems
        super().__init__("\n".join(f"{origin}: {problem}" for problem in problems))

    @classmethod
    def one(cls, origin: str, place: str, what: str, fix: str) -> Self:
        """An error of one defect."""
        return cls(origin, [DocumentProblem(place, what, fix)])


class DetectionError(CalibrationError):
    """The target was not found in an image. `code` is stable; `what` and `fix` are sentences for people."""

    def __init__(self, code: str, what: str, fix: str) -> None:
        self.code, self.what, self.fix = code, what, fix
        super().__init__(f"{what}: {fix}")


class ComparisonError(CalibrationError, ErrorWithFix, code="not-comparable"):
    """Two calibrations cannot be compared: one has no transform, or their set-ups differ."""


class ExportRefused(CalibrationError, ErrorWithFix, code="export-refused"):
    """Nothing can be exported: there is no transform, or an option cannot be."""


class GeometryError(CalibrationError):
    """A number is outside a function's domain: not a rotation, not finite, no axis."""


class UndeterminedError(CalibrationError):
    """The motions do not determine X. `code` is stable; `what` and `fix` are sentences for people."""

    def __init__(self, code: str, what: str, fix: str) -> None:
        self.code, self.what, self.fix = code, what, fix
        super().__init__(f"{what}: {fix}")
