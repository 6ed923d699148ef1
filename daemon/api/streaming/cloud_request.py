"""Parse the requests for clouds: pose and unit in the query, media types in the headers."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from fastapi import Depends, Query, Request

from calibration.documents.calibration_in_use import AS_BUILT, CalibrationInUse
from calibration.documents.pose import PoseDocument
from calibration.documents.validation import validate_document
from calibration.errors import DocumentProblem
from calibration.kinematics.arm_errors import AXES
from daemon.api.dependencies import DECIMAL
from daemon.api.http_errors import InvalidRequest, NotAcceptable, UnknownMediaType
from daemon.api.negotiation import media_ranges
from daemon.application import Application
from daemon.model.records import FlangePose
from daemon.scans.upload import LAZ, SUFFIXES
from registration.points.rigid_motion import MAX_TRANSLATION_MM

POSE = "base_T_flange as x,y,z,qw,qx,qy,qz (mm, w first), or 'now': where the arm stands"
PoseQuery = Annotated[str, Query(max_length=300, description=POSE, examples=["now"])]
JOINTS = "the arm's axes 1 to 6 at a given pose, degrees, with commas; where the arm's errors are active"
AXES_BESIDE = "the controller's external axes from the first at a given pose, mm or degrees, with commas"


@dataclass(frozen=True)
class BesidePose:
    """What a request says of the arm beside the pose of its flange."""

    joints: str | None
    external_axes: str | None

    @classmethod
    async def of_query(
        cls,
        joints: Annotated[str | None, Query(max_length=200, description=JOINTS)] = None,
        external_axes: Annotated[str | None, Query(max_length=200, description=AXES_BESIDE)] = None,
    ) -> "BesidePose":
        return cls(joints, external_axes)


Beside = Annotated[BesidePose, Depends(BesidePose.of_query)]
UnitQuery = Annotated[Literal["mm", "m"], Query(description="unit of the cloud's coordinates")]
ForceQuery = Annotated[bool, Query(description="take a cloud whose unit cannot be, too")]

SYNONYMS = {"application/ply": "application/x-ply", "model/ply": "application/x-ply",
            "application/pcd": "application/x-pcd", "application/x-laz": LAZ,
            "application/vnd.las": LAZ}  # fmt: skip

JSON = "application/json"
ANSWER_SUFFIXES = {"application/x-ply": ".ply", "application/x-pcd": ".pcd", "application/octet-stream": ".bin",
            LAZ: ".laz", JSON: ".bin"}  # fmt: skip
"""Media types of a merged cloud in order of preference, with the suffix of the file it is sent from."""

MAX_JOINT_DEG = 10_000.0

BINARY: dict[str, Any] = {"schema": {"type": "string", "format": "binary"}}
CLOUD_CONTENT: dict[str, Any] = dict.fromkeys(SUFFIXES, BINARY)
TAKES_A_CLOUD: dict[str, Any] = {"requestBody": {"required": True, "content": CLOUD_CONTENT}}


def media_type_of(request: Request) -> str:
    """The media type of the request's cloud. Raises UnknownMediaType."""
    given = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    media_type = SYNONYMS.get(given, given)
    if media_type not in SUFFIXES:
        raise UnknownMediaType(
            f"a cloud of type {given[:80]!r} is not taken" if given else "the request does not say what its body is",
            f"set Content-Type to one of {', '.join(SUFFIXES)} (octets are float32 x, y, z)",
        )
    return media_type


def choose_media_type(request: Request) -> str:
    """The media type of ANSWER_SUFFIXES that Accept prefers (RFC 9110, 12.5.1). Raises NotAcceptable."""
    weights: dict[str, tuple[float, int]] = {}
    for given, weight in media_ranges(request) or [("*/*", 1.0)]:
        media = SYNONYMS.get(given, given)
        for kind in ANSWER_SUFFIXES:
            ranges = ["*/*", kind.split("/")[0] + "/*", kind]
            narrowness = ranges.index(media) if media in ranges else -1
            if narrowness >= weights.get(kind, (0.0, -1))[1] and narrowness >= 0:
                weights[kind] = (weight, narrowness)
    best = max(ANSWER_SUFFIXES, key=lambda kind: weights.get(kind, (0.0, -1))[0])
    if weights.get(best, (0.0, -1))[0] <= 0:
        accept = request.headers.get("accept", "")[:80]
        fix = f"set Accept to one of {', '.join(ANSWER_SUFFIXES)}"
        raise NotAcceptable(f"a cloud is not answered as {accept!r}", fix)
    return best


async def flange_pose_of(app: Application, pose: str, beside: BesidePose) -> FlangePose:
    """Pose and axes of a request, or of the arm now. Raises InvalidRequest, DocumentError, NotStill, DeviceError."""
    if pose == "now":
        for name, given in vars(beside).items():
            if given is not None:
                fix = f"leave {name} out, or give the pose, too"
                raise InvalidRequest([DocumentProblem(f"query.{name}", "with pose=now the daemon reads them", fix)])
        return FlangePose.of(await app.readings.settled_pose.read())
    joints, axes = (
        None if text is None else _numbers(name, text, counts, within, form)
        for name, text, counts, within, form in (
            ("joints", beside.joints, range(AXES, AXES + 1), MAX_JOINT_DEG, JOINTS),
            ("external_axes", beside.external_axes, range(1, AXES + 1), MAX_TRANSLATION_MM, AXES_BESIDE),
        )
    )
    numbers = _numbers("pose", pose, range(7, 8), MAX_TRANSLATION_MM, POSE)
    data = {"translation_mm": numbers[:3], "quaternion_wxyz": numbers[3:]}
    return FlangePose(validate_document(PoseDocument, data, "query.pose"), joints, axes)


def _numbers(name: str, text: str, counts: range, within: float, form: str) -> tuple[float, ...]:
    """The numbers with commas of a parameter, as many as one of `counts`. Raises InvalidRequest."""
    parts = text.split(",")
    numbers = tuple(float(part.replace(" ", "+")) for part in parts if DECIMAL.fullmatch(part))
    if len(parts) not in counts or len(numbers) != len(parts):
        many = counts[-1] if len(counts) == 1 else f"up to {counts[-1]}"
        what = f"{text[:60]!r} is not {many} numbers"
        raise InvalidRequest([DocumentProblem(f"query.{name}", what, f"give {form}")])
    if max(map(abs, numbers)) > within:
        what = f"a number is beyond {within:g} either way"
        raise InvalidRequest([DocumentProblem(f"query.{name}", what, f"give {form}")])
    return numbers


def arm_headers(calibration: CalibrationInUse, poses: Sequence[FlangePose]) -> dict[str, str]:
    """Headers of a cloud in base: whether the arm's errors are in it, how well it is placed by them at these poses, and
    a warning for poses without joints and for another load.

    With errors of the arm it takes inverse kinematics: for a worker thread. Raises UnreachablePoseError.
    """
    stances = [pose.stance for pose in poses]
    placement = calibration.placement(stances)
    if placement is None:
        return {}
    found = {
        "Handeyed-Arm": AS_BUILT,
        "Handeyed-Point-Sigma-Mm": f"{placement.point_mm:.4f}",
        "Handeyed-Joints-Seen": str(placement.seen).lower(),
    }
    if warnings := calibration.findings(stances):
        found["Handeyed-Warning"] = ", ".join(warning.code for warning in warnings)
    return found
