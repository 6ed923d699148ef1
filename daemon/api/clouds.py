"""What the routes for clouds share: pose and unit in the query, media type in the header."""

from typing import Annotated, Any, Literal

from fastapi import Query, Request

from calibration.documents.pose import PoseDocument
from calibration.documents.validation import validate_document
from calibration.errors import DocumentProblem
from daemon.errors import RequestRefused, UnknownMediaType
from daemon.scans import SUFFIXES

POSE = "base_T_flange as x,y,z,qw,qx,qy,qz (mm, w first), or 'now': where the arm stands"
PoseQuery = Annotated[str, Query(max_length=300, description=POSE, examples=["now"])]
UnitQuery = Annotated[Literal["mm", "m"], Query(description="unit of the cloud's coordinates")]

SYNONYMS = {"application/ply": "application/x-ply", "model/ply": "application/x-ply",
            "application/pcd": "application/x-pcd"}  # fmt: skip

BINARY: dict[str, Any] = {"schema": {"type": "string", "format": "binary"}}
CLOUD_CONTENT: dict[str, Any] = dict.fromkeys(SUFFIXES, BINARY)
TAKES_A_CLOUD: dict[str, Any] = {"requestBody": {"required": True, "content": CLOUD_CONTENT}}


def media_type_of(request: Request) -> str:
    """The cloud's format. Raises UnknownMediaType."""
    given = request.headers.get("content-type", "").partition(";")[0].strip().lower()
    media_type = SYNONYMS.get(given, given)
    if media_type not in SUFFIXES:
        raise UnknownMediaType(
            f"a cloud of type {given[:80]!r} is not taken" if given else "the request does not say what its body is",
            f"set Content-Type to one of {', '.join(SUFFIXES)} (the last for float32 x, y, z octets)",
        )
    return media_type


def parse_pose(text: str) -> PoseDocument:
    """Seven numbers as a pose. Raises RequestRefused, DocumentError."""
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != 7:
        problem = DocumentProblem("query.pose", f"{text[:60]!r} is not seven numbers", f"give {POSE}")
        raise RequestRefused([problem])
    data = {"translation_mm": numbers[:3], "quaternion_wxyz": numbers[3:]}
    return validate_document(PoseDocument, data, "query.pose")
