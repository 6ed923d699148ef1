"""Bodies of requests that start something."""

from typing import Annotated

from pydantic import Field, PositiveFloat

from calibration.documents.target import TargetDocument
from calibration.documents.validation import Document
from daemon.settings import TaughtPose

Stations = Annotated[tuple[TaughtPose, ...], Field(min_length=1, max_length=100)]


class CalibrateRequest(Document):
    """Everything is optional: poses of the flange (else taught ones, else planned ones), how many, another target.

    `uncertainty_mm`: planning ends when a mapped point is known as well as this (one sigma); `count` is then the most.
    """

    poses: Annotated[tuple[TaughtPose, ...], Field(min_length=3, max_length=100)] | None = None
    count: Annotated[int, Field(ge=3, le=100)] | None = None
    uncertainty_mm: PositiveFloat | None = None
    target: TargetDocument | None = None


class VerifyRequest(Document):
    """Poses to look at the target from; by default three of those a calibration would take."""

    poses: Annotated[tuple[TaughtPose, ...], Field(min_length=2, max_length=100)] | None = None
    target: TargetDocument | None = None


class ScanRequest(Document):
    """A new scan. With `poses`, or `capture`, the arm is driven and the daemon's scanner fills it.

    `refine`: after each view the views are fitted to each other in the background, within the robot's noise.
    """

    name: Annotated[str, Field(max_length=200, pattern=r"^[^\x00-\x1f\x7f]*$")] = ""
    capture: bool = False
    refine: bool = False
    poses: Stations | None = None

    @property
    def moves_the_arm(self) -> bool:
        return self.capture or self.poses is not None


class ApplyRequest(Document):
    """Who applies a calibration; a rejected one is applied only when `despite_verdict` says so."""

    applied_by: Annotated[str, Field(min_length=1, max_length=200, pattern=r"^[^\x00-\x1f\x7f]*$")] = "operator"
    despite_verdict: bool = False
