"""One scan of an archive: registered, unless a manifest says that this was done already. Runs in any process."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from calibration.documents.calibration import CalibrationDocument
from calibration.documents.validation import parse_document
from calibration.errors import CalibrationError
from daemon.tools.batch_registration.errors import ArchiveError
from daemon.tools.batch_registration.manifest import NAME, ManifestDocument, hash_of_inputs, written
from daemon.tools.batch_registration.remote_folder import Place
from registration.documents import ScanDocument
from registration.errors import RegistrationError
from registration.fusion.merging import Merge
from registration.report import register_scan
from registration.scan import Hand, ScanView, hand_of, read_scan

SCAN, MERGED, REPORT = "scan.json", "merged.ply", "report.json"

State = Literal["registered", "unchanged", "failed"]


@dataclass(frozen=True)
class Task:
    """Everything a worker on another machine has to know."""

    source: str
    target: str
    scan: str
    calibration: str
    refine: bool = False
    voxel_mm: float | None = None

    @property
    def about(self) -> bytes:
        """What beside the clouds decides the result."""
        return json.dumps([self.calibration, self.refine, self.voxel_mm]).encode()


@dataclass(frozen=True)
class Outcome:
    """What became of one scan; `accepted` is its verdict, `error` why it failed."""

    scan: str
    state: State
    points: int = 0
    accepted: bool = True
    error: str | None = None


def register_one(task: Task) -> Outcome:
    """Whatever is wrong with this scan is its outcome: the others go on."""
    try:
        return _registered(task)
    except (RegistrationError, CalibrationError, ArchiveError) as error:
        return _failed(task, str(error))
    except OSError as error:
        return _failed(task, f"it cannot be read or written ({error}): check rights and free space")


def _failed(task: Task, what: str) -> Outcome:
    return Outcome(task.scan, "failed", accepted=False, error=what)


def _registered(task: Task) -> Outcome:
    source, target = Place(task.source).child(task.scan), Place(task.target).child(task.scan)
    calibration = parse_document(CalibrationDocument, task.calibration.encode(), "calibration")
    names = _names(source)
    with source.fetched(names) as folder:
        views = read_scan(folder)
        for view in views:
            if not view.path.is_file():
                raise FileNotFoundError(f"{task.scan}/{view.path.name} is missing")
        inputs = hash_of_inputs(folder, names, task.about)
        done = _finished(target, inputs, calibration.id)
        if done is not None:
            return Outcome(task.scan, "unchanged", done.points, done.accepted)
        target.remove(NAME)  # what it speaks of is about to be replaced
        with target.filled() as out:
            manifest = _register(task, views, hand_of(calibration), out, inputs)
    target.write(NAME, manifest.model_dump_json(indent=1).encode())
    return Outcome(task.scan, "registered", manifest.points, manifest.accepted)


def _names(source: Place) -> list[str]:
    """The scan's files, scan.json first. Raises DocumentError, ArchiveError."""
    content = source.read(SCAN)
    if content is None:
        raise ArchiveError(f"{source.url}/{SCAN} is gone", "start again")
    document = parse_document(ScanDocument, content, f"{source.url}/{SCAN}")
    clouds = dict.fromkeys(view.cloud for view in document.views)
    return [SCAN, *(name for name in clouds if Path(name).name == name)]  # read_scan refuses any other


def _finished(target: Place, inputs: str, calibration_id: str) -> ManifestDocument | None:
    """The manifest, when it speaks of these inputs and its files are there."""
    content = target.read(NAME)
    if content is None:
        return None
    try:
        manifest = parse_document(ManifestDocument, content, f"{target.url}/{NAME}")
    except CalibrationError:
        return None
    same = (manifest.input_sha256, manifest.calibration_id) == (inputs, calibration_id)
    whole = all(target.size(file.name) == file.bytes for file in manifest.files)
    return manifest if same and whole else None


def _register(task: Task, views: list[ScanView], hand: Hand, out: Path, inputs: str) -> ManifestDocument:
    report = register_scan(views, hand, out / MERGED, _no_clock, refine=task.refine, merge=Merge(task.voxel_mm))
    Place(str(out)).write(REPORT, report.model_dump_json(indent=1).encode())
    return ManifestDocument(
        scan=task.scan,
        calibration_id=hand.calibration_id,
        input_sha256=inputs,
        points=report.points,
        accepted=report.verdict.accepted,
        files=[written(out / MERGED), written(out / REPORT)],
    )


def _no_clock() -> float:
    """Times would make every run's report another."""
    return 0.0
