"""profiles.json (sweeps of a line profiler), and the report of a registration."""

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field, with_config

from calibration.documents.calibration import CorrectionDocument, VerdictDocument
from calibration.documents.pose import PoseDocument
from calibration.documents.validation import Document
from calibration.sentences.described import Described
from calibration.targets import IN_DOCUMENTS

Positive = Annotated[float, Field(gt=0)]


TimeUnit = Literal["s", "ms", "us", "us/1.024"]


class ProfileArtefactDocument(Document):
    """What stands in base and is swept over: a sphere of a radius, or a plane (null)."""

    name: str
    """Name by which the sweeps refer to it."""
    radius_mm: float | None
    """Radius of a sphere, mm; null for a plane."""


class ProfileSweepDocument(Document):
    """One sweep: files of its profiles and of the arm's path, and the artefact it crosses."""

    profiles: str
    """Name of a file beside the document: .npz or .csv."""
    path: str
    """Name of a .csv beside the document: base_T_flange along the path, with the robot's times."""
    artefact: str | None = None
    """Name of the artefact it crosses; null for a part, which is only registered."""


class ProfilesDocument(Document):
    """Content of profiles.json."""

    heading = "profilesjson"

    schema_version: Literal[1]
    """Version of the format."""
    source: str = ""
    """Where it came from, for people."""
    time_unit: TimeUnit
    """Of the profiles' times; us/1.024 in exports of LMI's sensors; never guessed."""
    artefacts: tuple[ProfileArtefactDocument, ...] = ()
    """What is swept over to calibrate; each stands where it is in all its sweeps."""
    sweeps: list[ProfileSweepDocument]
    """The sweeps, each along one path of the arm."""


class RegisteredViewDocument(Document):
    """One registered view."""

    index: int
    """Of the view, from 0."""
    cloud: str
    """Name of a cloud beside the document."""
    points: int
    """Number of points."""
    base_T_camera: PoseDocument
    """The camera in the base when the view was taken, mm."""
    correction: CorrectionDocument | None
    """Small motion of the view by the refinement; null without."""
    overlap: float
    """Share of the points that other views see, 0 to 1."""
    rms_mm: float | None
    """Deviation from the other views, mm; null without overlap."""
    free_directions: list[str]
    """Motions that the overlap does not determine."""


class DeviationDocument(Document):
    """Point-to-plane RMS between overlapping views; null where none overlap, `after` null without refinement."""

    before: float | None
    """Before the refinement, mm; null where no views overlap."""
    after: float | None
    """After it, mm; null without refinement."""


@with_config(IN_DOCUMENTS)
@dataclass(frozen=True)
class Seconds(Described):
    """Durations of the steps in seconds."""

    read: float
    """Reading, s."""
    register: float
    """Registration, s."""
    write: float
    """Writing, s."""


class RegistrationReportDocument(Document):
    """Output of `handeyed register --json`."""

    heading = "report"

    schema_version: Literal[1] = 1
    """Version of the format."""
    calibration_id: str
    """Of the calibration that was used."""
    views: list[RegisteredViewDocument]
    """One entry for each view."""
    points: int
    """Number of points."""
    rms_mm: DeviationDocument
    """Point-to-plane deviation between overlapping views, mm."""
    seconds: Seconds
    """Durations, s."""
    verdict: VerdictDocument
    """Whether it may be used, and why not."""
