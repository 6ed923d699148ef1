"""scan.json (clouds with poses), profiles.json (sweeps of a line profiler), and the report of a registration."""

from typing import Annotated, Literal

from pydantic import Field
from typing_extensions import TypedDict

from calibration.documents.calibration import CorrectionDocument, VerdictDocument
from calibration.documents.external_axis import ExternalAxes
from calibration.documents.pose import PoseDocument
from calibration.documents.validation import Document
from calibration.problem import Setup
from registration.points.rigid_motion import Unit


class ScanViewDocument(Document):
    """One cloud, its unit (never guessed), its flange pose, and the arm's axes there where they are known.

    `external_axes`: the controller's axes beside the arm, mm or degrees; needed where the calibration has one.
    """

    cloud: str
    unit: Unit
    base_T_flange: PoseDocument
    joints_deg: Annotated[tuple[float, ...], Field(min_length=1, max_length=12)] | None = None
    external_axes: ExternalAxes | None = None


class ScanDocument(Document):
    """Content of scan.json."""

    heading = "scanjson"

    schema_version: Literal[1]
    source: str = ""
    setup: Setup
    views: list[ScanViewDocument]


TimeUnit = Literal["s", "ms", "us", "us/1.024"]


class ProfileArtefactDocument(Document):
    """What stands in base and is swept over: a sphere of a radius, or a plane (null)."""

    name: str
    radius_mm: float | None


class ProfileSweepDocument(Document):
    """One sweep: files of its profiles and of the arm's path, and the artefact it crosses, null of a part."""

    profiles: str
    path: str
    artefact: str | None = None


class ProfilesDocument(Document):
    """Content of profiles.json."""

    heading = "profilesjson"

    schema_version: Literal[1]
    source: str = ""
    time_unit: TimeUnit
    artefacts: tuple[ProfileArtefactDocument, ...] = ()
    sweeps: list[ProfileSweepDocument]


class RegisteredViewDocument(Document):
    """One registered view: `overlap` is the share seen by other views, `rms_mm` the deviation from them."""

    index: int
    cloud: str
    points: int
    base_T_camera: PoseDocument
    correction: CorrectionDocument | None
    overlap: float
    rms_mm: float | None
    free_directions: list[str]


class DeviationDocument(Document):
    """Point-to-plane RMS between overlapping views; null where none overlap, `after` null without refinement."""

    before: float | None
    after: float | None


class Seconds(TypedDict):
    """Durations of the steps in seconds."""

    read: float
    register: float
    write: float


class RegistrationReportDocument(Document):
    """Output of `handeyed register --json`."""

    heading = "report"

    schema_version: Literal[1] = 1
    calibration_id: str
    views: list[RegisteredViewDocument]
    points: int
    rms_mm: DeviationDocument
    seconds: Seconds
    verdict: VerdictDocument


class StitchedPairDocument(Document):
    """Two views of one surface: by how much the second (`views[1]`) lies off the first, in the base.

    `gap_mm`: median along the first's normals, positive towards its scanner; `width_mm`: of the middle 95 % of the
    distances. `base_offset_mm`: the shift that explains them best, along `directions`, which the normals show: one of a
    plane, two of an edge, three of a corner; `sigma_mm`: of it along each, by the scanner's noise alone.
    """

    views: tuple[int, int]
    gap_mm: float
    width_mm: float
    base_offset_mm: tuple[float, float, float]
    offset_mm: float
    directions: tuple[tuple[float, float, float], ...]
    sigma_mm: tuple[float, ...]
    pairs: int
    overlap: float


class StitchingDocument(Document):
    """The gaps between all views that overlap; `largest_mm`: of gaps and shifts."""

    heading = "stitching"

    schema_version: Literal[1] = 1
    calibration_id: str
    largest_mm: float
    pairs: tuple[StitchedPairDocument, ...]
