"""A scan on disk: scan.json beside its clouds, and all of them as one cloud in the robot's base frame."""

import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Literal

from calibration.documents.calibration import (
    CalibrationDocument,
    CorrectionDocument,
    FindingDocument,
    VerdictDocument,
)
from calibration.documents.pose import PoseDocument
from calibration.documents.validation import Document, parse_document
from calibration.errors import DocumentError, DocumentProblem
from calibration.transforms import Array
from daemon.session_folder import read_bytes
from registration.columns import shared_layout
from registration.files import moved_blocks
from registration.motion import Motion
from registration.reading import open_cloud
from registration.writing import new_cloud

SCAN_FILE = "scan.json"


class ScannedViewDocument(Document):
    """One cloud; its unit is stated, never guessed."""

    cloud: str
    unit: Literal["m", "mm"]
    base_T_flange: PoseDocument


class ScanDocument(Document):
    """The whole of scan.json."""

    schema_version: Literal[1]
    source: str = ""
    setup: Literal["eye-in-hand"]
    views: list[ScannedViewDocument]


class RegisteredViewDocument(Document):
    """Where a view was put; the plain formula corrects nothing and measures no overlap."""

    index: int
    cloud: str
    points: int
    base_T_camera: PoseDocument
    correction: CorrectionDocument
    overlap: float | None
    rms_mm: float | None


class RmsDocument(Document):
    """Between overlapping views; null where it was not measured."""

    before: float | None
    after: float | None


class RegistrationDocument(Document):
    """What `handeyed register --json` prints."""

    schema_version: Literal[1] = 1
    calibration_id: str
    views: list[RegisteredViewDocument]
    points: int
    rms_mm: RmsDocument
    seconds: dict[str, float]
    verdict: VerdictDocument


@dataclass(frozen=True)
class ScanFolder:
    """A parsed scan.json and the folder its clouds lie in."""

    path: Path
    document: ScanDocument


def open_scan(path: Path) -> ScanFolder:
    """The scan in folder `path` (or the scan.json at `path`). Raises DocumentError."""
    folder = path.parent if path.name == SCAN_FILE else path
    file = folder / SCAN_FILE
    if not folder.is_dir():
        problem = DocumentProblem("folder", "not there" if not folder.exists() else "not a folder", "check the path")
        raise DocumentError(str(folder), [problem])
    document = parse_document(ScanDocument, read_bytes(file), str(file))
    problems = [
        DocumentProblem(f"views[{index}].cloud", f"'{view.cloud}' is outside the scan's folder", "copy it there")
        for index, view in enumerate(document.views)
        if PurePosixPath(view.cloud).is_absolute() or ".." in PurePosixPath(view.cloud).parts
    ]
    if not document.views:
        problems.append(DocumentProblem("views", "there are none", "a scan needs a view"))
    if problems:
        raise DocumentError(str(file), problems)
    return ScanFolder(folder, document)


def register_plainly(scan: ScanFolder, calibration: CalibrationDocument, out: Path) -> RegistrationDocument:
    """Every view by P_base = base_T_flange flange_T_camera P_camera (paper, Eq. 10 in our direction), as one cloud.

    `out` is whole or as it was. Raises RegistrationError's leaves, DocumentError when there is no transform.
    """
    if calibration.flange_T_camera is None:
        what = "it holds no flange_T_camera"
        fix = "use an eye-in-hand calibration that was solved"
        raise DocumentError(f"calibration {calibration.id}", [DocumentProblem("flange_T_camera", what, fix)])
    flange_T_camera = calibration.flange_T_camera.transform()
    poses = [view.base_T_flange.transform() @ flange_T_camera for view in scan.document.views]
    began_s = time.perf_counter()
    counts = _merge(scan, poses, out)
    views = [
        RegisteredViewDocument(
            index=index,
            cloud=view.cloud,
            points=counts[index],
            base_T_camera=PoseDocument.of(poses[index]),
            correction=CorrectionDocument(translation_mm=(0.0, 0.0, 0.0), rotation_deg=(0.0, 0.0, 0.0)),
            overlap=None,
            rms_mm=None,
        )
        for index, view in enumerate(scan.document.views)
    ]
    return RegistrationDocument(
        calibration_id=calibration.id,
        views=views,
        points=sum(counts),
        rms_mm=RmsDocument(before=None, after=None),
        seconds={"read": 0.0, "register": 0.0, "write": time.perf_counter() - began_s},
        verdict=VerdictDocument(accepted=calibration.verdict.accepted, findings=list(_findings(calibration))),
    )


def _merge(scan: ScanFolder, poses: list[Array], out: Path) -> list[int]:
    """Points written of each view; read, moved and written block by block."""
    files = [scan.path / view.cloud for view in scan.document.views]
    layouts = []
    for file in files:
        with open_cloud(file, str(file)) as cloud:
            layouts.append(cloud.layout)
    layout, _ = shared_layout(layouts)
    counts = []
    with new_cloud(out, layout) as writer:
        for file, view, base_T_camera in zip(files, scan.document.views, poses, strict=True):
            before = writer.points
            with open_cloud(file, str(file)) as cloud:
                for block in moved_blocks(cloud, Motion.of(base_T_camera, view.unit), writer.form.layout):
                    writer.write(block)
            counts.append(writer.points - before)
    return counts


def _findings(calibration: CalibrationDocument) -> Iterator[FindingDocument]:
    if not calibration.verdict.accepted:
        yield FindingDocument(
            code="calibration-not-accepted",
            severity="error",
            message=f"calibration {calibration.id} was not accepted by its own verdict",
            fix="calibrate again, and register with the new one",
        )
    yield FindingDocument(
        code="plain-formula",
        severity="info",
        message="views are placed by the robot's poses alone; how well they fit each other was not measured",
        fix="",
    )
