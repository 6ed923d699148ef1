"""scan.json (clouds with poses), profiles.json (sweeps of a line profiler), and the report of a registration."""

from dataclasses import dataclass
from typing import Annotated, Literal

from pydantic import Field, with_config

from calibration.documents.calibration import CorrectionDocument, VerdictDocument
from calibration.documents.external_axis import ExternalAxes
from calibration.documents.pose import PoseDocument
from calibration.documents.validation import Document
from calibration.problem import Setup
from calibration.sentences.described import Described
from calibration.targets import IN_DOCUMENTS
from registration.points.rigid_motion import Unit

Positive = Annotated[float, Field(gt=0)]


class ScanViewDocument(Document):
    """One cloud, its flange pose, and the arm's axes there where they are known. `external_axes`: needed where the
    calibration has one."""

    cloud: str
    """Name of a cloud beside the document."""
    unit: Unit
    """Of the cloud's lengths: m or mm; never guessed."""
    base_T_flange: PoseDocument
    """The flange (tool0) in the base (wobj0): maps coordinates of the flange to the base, mm."""
    joints_deg: Annotated[tuple[float, ...], Field(min_length=1, max_length=12)] | None = None
    """Joint angles where they were recorded, degrees."""
    external_axes: ExternalAxes | None = None
    """The controller's axes beside the arm at the pose, mm or degrees; null for one it does not have."""


class ScanDocument(Document):
    """Content of scan.json."""

    heading = "scanjson"

    schema_version: Literal[1]
    """Version of the format."""
    source: str = ""
    """Where it came from, for people."""
    setup: Setup
    """eye-in-hand: the camera is on the flange; eye-to-hand: the camera stands in the cell."""
    range_mm: tuple[Positive, Positive] | None = None
    """Nearest and farthest at which the scanner measures, as its data sheet states; null where that is not known."""
    views: list[ScanViewDocument]
    """The clouds of one part."""


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


class StitchedPairDocument(Document):
    """Two views of one surface: by how much the second lies off the first, in the base."""

    views: tuple[int, int]
    """Numbers of the two views, from 0."""
    gap_mm: float
    """Median distance along the first's normals, positive towards its scanner, mm."""
    width_mm: float
    """Width of the middle 95 % of the distances, mm."""
    base_offset_mm: tuple[float, float, float]
    """The shift that explains the distances best, along the base's axes, mm."""
    offset_mm: float
    """Its length, mm."""
    directions: tuple[tuple[float, float, float], ...]
    """Directions in the base that the normals show: one of a plane, two of an edge, three of a corner."""
    sigma_mm: tuple[float, ...]
    """Of the shift along each direction, by the scanner's noise, mm."""
    pairs: int
    """Number of pairs of points."""
    overlap: float
    """Share of the second's points that have a partner, 0 to 1."""


class StitchingDocument(Document):
    """The gaps between all views that overlap."""

    heading = "stitching"

    schema_version: Literal[1] = 1
    """Version of the format."""
    calibration_id: str
    """Of the calibration that was used."""
    largest_mm: float
    """Largest of the gaps and shifts, mm."""
    pairs: tuple[StitchedPairDocument, ...]
    """The pairs of views that overlap."""
