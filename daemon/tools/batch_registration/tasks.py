"""Register one scan of an archive, unless its manifest matches the inputs. Runs in any process."""

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from calibration.documents.arm import ArmErrorsDocument
from calibration.documents.calibration import CalibrationDocument
from calibration.documents.calibration_in_use import CalibrationInUse
from calibration.documents.validation import Document, parse_document
from calibration.errors import CalibrationError
from daemon.tools.batch_registration.remote_folder import ArchiveError, RemoteFolder
from registration.errors import RegistrationError
from registration.fusion.merging import Merge
from registration.io.regular_file import open_regular
from registration.scan import scanner_mount_of
from registration.scan_folder import ScanDocument, place_views, read_scan, register_scan

MANIFEST_NAME = "manifest.json"
"""Hashes of a registered scan's inputs and files. Written last, so it marks a finished scan."""


class WrittenDocument(Document):
    """A file with its size in bytes and SHA-256."""

    name: str
    """Name of the file."""
    bytes: int
    """Its size in bytes."""
    sha256: str
    """SHA-256 of its content, hexadecimal."""


class ManifestDocument(Document):
    """A finished scan."""

    heading = "manifestjson"

    schema_version: Literal[1] = 1
    """Version of the format."""
    scan: str
    """Folder of the scan, below the archive's."""
    calibration_id: str
    """Of the calibration that was used."""
    input_sha256: str
    """SHA-256 over scan.json, the clouds that it names, the calibration and the options."""
    points: int
    """Number of points."""
    accepted: bool
    """The verdict of the scan's report."""
    files: list[WrittenDocument]
    """What was written beside it."""


def file_hash(path: Path) -> str:
    """The SHA-256 of a file's content, hexadecimal."""
    with open_regular(path) as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def describe_file(path: Path) -> WrittenDocument:
    return WrittenDocument(name=path.name, bytes=path.stat().st_size, sha256=file_hash(path))


SCAN, MERGED, REPORT = "scan.json", "merged.ply", "report.json"

State = Literal["registered", "unchanged", "failed"]


@dataclass(frozen=True)
class RegistrationTask:
    """The input of one task, serialisable for workers on other machines."""

    source: str
    target: str
    scan: str
    calibration: str
    refine: bool = False
    voxel_mm: float | None = None
    arm: str | None = None
    force: bool = False

    @property
    def about(self) -> bytes:
        """The inputs beside the clouds, as bytes for the hash."""
        further = [one for one in (self.arm, self.force) if one]
        return json.dumps([self.calibration, self.refine, self.voxel_mm, *further]).encode()


class OutcomeDocument(Document):
    """The outcome of one scan: a line of `register-archive --json`."""

    heading = "outcome"

    scan: str
    """Folder of the scan, below the archive's."""
    state: State
    """registered; unchanged: it was there already; failed."""
    points: int = 0
    """Number of points."""
    accepted: bool = True
    """The verdict of the scan's report; false where it failed."""
    error: str | None = None
    """Why it failed, and what to do; null otherwise."""


def run_task(task: RegistrationTask) -> OutcomeDocument:
    """Register one scan; an error becomes a failed outcome, so that the other scans go on."""
    try:
        return _register_scan(task)
    except (RegistrationError, CalibrationError, ArchiveError) as error:
        return outcome_of_failure(task.scan, str(error))
    except OSError as error:
        return outcome_of_failure(task.scan, f"it cannot be read or written ({error}): check rights and free space")


def outcome_of_failure(scan: str, what: str) -> OutcomeDocument:
    return OutcomeDocument(scan=scan, state="failed", accepted=False, error=what)


def _register_scan(task: RegistrationTask) -> OutcomeDocument:
    source, target = RemoteFolder(task.source).child(task.scan), RemoteFolder(task.target).child(task.scan)
    calibration = parse_document(CalibrationDocument, task.calibration.encode(), "calibration")
    arm = None if task.arm is None else parse_document(ArmErrorsDocument, task.arm.encode(), "arm")
    given = CalibrationInUse.of(calibration, arm)
    content = source.read(SCAN)
    if content is None:
        raise ArchiveError(f"{source.url}/{SCAN} is gone", "start again")
    document = parse_document(ScanDocument, content, f"{source.url}/{SCAN}")
    clouds = dict.fromkeys(view.cloud for view in document.views)
    names = [SCAN, *(name for name in clouds if Path(name).name == name)]  # read_scan refuses any other
    with source.fetch(names) as folder:
        scanned = read_scan(folder)
        views = place_views(given, scanned)
        for view in views:
            if not view.path.is_file():
                raise FileNotFoundError(f"{task.scan}/{view.path.name} is missing")
        whole = hashlib.sha256(task.about)
        for name in names:
            whole.update(f"\n{name}\n{file_hash(folder / name)}".encode())
        inputs = whole.hexdigest()
        done = _matching_manifest(target, inputs, given.document.id)
        if done is not None:
            return OutcomeDocument(scan=task.scan, state="unchanged", points=done.points, accepted=done.accepted)
        target.remove(MANIFEST_NAME)  # its files are about to be replaced
        merge, findings = Merge(task.voxel_mm), given.findings([view.stance for view in scanned])
        with target.upload_after() as out:
            report = register_scan(
                views, scanner_mount_of(given.document), out / MERGED,
                lambda: 0.0,  # a clock that stands still: equal inputs give equal reports
                refine=task.refine, merge=merge, further=findings, force=task.force,
            )  # fmt: skip
            RemoteFolder(str(out)).write(REPORT, report.model_dump_json(indent=1).encode())
            manifest = ManifestDocument(
                scan=task.scan,
                calibration_id=given.document.id,
                input_sha256=inputs,
                points=report.points,
                accepted=report.verdict.accepted,
                files=[describe_file(out / MERGED), describe_file(out / REPORT)],
            )
    target.write(MANIFEST_NAME, manifest.model_dump_json(indent=1).encode())
    return OutcomeDocument(scan=task.scan, state="registered", points=manifest.points, accepted=manifest.accepted)


def _matching_manifest(target: RemoteFolder, inputs: str, calibration_id: str) -> ManifestDocument | None:
    """The manifest in `target` when it is of these inputs and its files exist; else None."""
    content = target.read(MANIFEST_NAME)
    if content is None:
        return None
    try:
        manifest = parse_document(ManifestDocument, content, f"{target.url}/{MANIFEST_NAME}")
    except CalibrationError:
        return None
    same = (manifest.input_sha256, manifest.calibration_id) == (inputs, calibration_id)
    whole = all(target.size(file.name) == file.bytes for file in manifest.files)
    return manifest if same and whole else None
