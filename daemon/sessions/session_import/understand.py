"""Reads a folder, finds the target in its images, and decides how the robot's poses are meant."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from calibration.diagnosis.evidence import Evidence
from calibration.diagnosis.plausibility import circle_of
from calibration.documents.imports.conventions import Convention, LengthUnit
from calibration.documents.imports.pairs import equal_sides
from calibration.documents.imports.pose_table import PoseTable
from calibration.documents.imports.readings import Decision, Reading, compare, decide, readings_of
from calibration.documents.imports.refusal import refusal
from calibration.documents.imports.sets.folder import CLOUDS, ImportedSet
from calibration.documents.imports.sets.kinds import read_set
from calibration.documents.imports.target_text import FORMS, example, target_of_data
from calibration.documents.imports.view_evidence import evidence_of_views
from calibration.documents.pose import PoseDocument
from calibration.documents.session import CameraDocument, SessionDocument, ViewDocument
from calibration.documents.target import TargetDocument
from calibration.errors import DocumentError, GeometryError
from calibration.problem import Problem, Setup
from calibration.transforms import Array
from daemon.sessions.session_files import ImageError, read_grey
from daemon.sessions.session_import.folder_files import FolderFiles
from daemon.sessions.session_import.request import ImportRequest, Understood, require_cloud_unit
from daemon.sessions.session_reader import SessionFolder, load_problem
from registration.io.regular_file import read_regular

Progress = Callable[[int, int], None]

SETUPS: tuple[Setup, Setup] = ("eye-in-hand", "eye-to-hand")


class Undecided(DocumentError):
    """The data do not decide how the poses are meant; the message names what has to be given."""


def understand(request: ImportRequest, progress: Progress = lambda done, of: None) -> Understood:
    """What the folder holds. Raises DocumentError, Undecided."""
    files = FolderFiles.of(request.folder)
    imported = read_set(files, request.part, request.chosen, request.arm)
    _require_motion(imported.poses)
    if imported.camera_poses is not None and equal_sides(imported.poses, imported.camera_poses):
        what = f"the robot's poses ({imported.poses.layout}) and the camera's are the same numbers"
        raise refusal(imported.poses.origin, "pairs", what, "give the poses that the robot reported", "pose-pairs")
    images = tuple(files.path(name).absolute() for name in imported.images)
    target = _target(request, imported)
    camera = _camera(request, imported, images)
    seen = None if imported.camera_poses is None else _camera_poses(imported.camera_poses)
    if images and target is None and not _are_clouds(images):
        forms = ", ".join(example(kind) for kind in list(FORMS)[:3])
        raise refusal(request.folder.name, "target", "not stated by the folder", f"give --target: {forms}", "targets")
    readings = _readings(request, imported, is_scan=bool(images) and target is None)
    evidence, missing = None, ""
    if target is not None or seen is not None:
        document = _document(images, seen, target, camera, request.cloud_unit or imported.cloud_unit, request)
        problem = _load(SessionFolder(request.folder, document), progress)
        evidence, missing = evidence_of_views(problem), _missing(problem)
    compared = compare(imported.poses, readings, evidence)
    decision = decide(imported.poses, compared, evidence)
    if decision.reading is None:
        raise _undecided(imported.poses, readings, decision, missing)
    poses = imported.poses.poses(decision.reading.convention, decision.reading.unit, decision.reading.frame)
    _require_two_sides(imported, evidence, poses)
    unused = imported.camera is not None and camera is None and bool(images) and request.camera is None
    lens = ("the set's intrinsics state no distortion and are not used; --camera uses them",) if unused else ()
    links = (f"{len(files.links)} links are not followed",) if files.links else ()
    small = decision.reading.unit == "mm" and request.unit is None and imported.poses.is_perhaps_in_cm()
    size = ("lengths without a unit are taken as mm; were they cm, name the columns x_cm, y_cm, z_cm",) if small else ()
    far = imported.poses.doubtful_reach(decision.reading.unit) if request.unit is None else ""
    still = [label for label, pose in zip(imported.poses.labels, poses, strict=True) if np.allclose(pose, np.eye(4))]
    own = (f"pose {still[0]} is the identity: are the poses relative to it, and not to the base?",) if still else ()
    unseen = (f"the poses are not compared with the pictures{missing}",) if evidence is None and missing else ()
    notes = (*imported.poses.notes, *imported.notes, *size, *filter(None, [far]), *own, *unseen, *lens, *links)
    return Understood(
        request, imported, decision.reading, decision.words, poses, seen, images, target, camera, notes
    )  # fmt: skip


def _require_motion(table: PoseTable) -> None:
    """Raises DocumentError when all poses of several are the same."""
    numbers = np.concatenate([table.lengths, table.numbers], axis=1)
    if len(numbers) > 1 and np.all(numbers == numbers[0]):
        what = f"all {len(numbers)} poses are the same"
        raise refusal(table.origin, "poses", what, "give the pose of the flange at each picture")


def _require_two_sides(imported: ImportedSet, evidence: Evidence | None, base_T_flange: Array) -> None:
    """Raises DocumentError when the robot's poses are the camera's own."""
    if evidence is None:
        return
    finding = circle_of(evidence.with_robot_poses(base_T_flange[evidence.indices]))
    if finding is not None:
        raise refusal(imported.poses.origin, "poses", finding.message, finding.fix)


def _load(session: SessionFolder, progress: Progress) -> Problem:
    """The problem of a session. Raises DocumentError with one problem, however many pictures have it."""
    try:
        return load_problem(session, progress)
    except DocumentError as error:
        first, count = error.problems[0], len(error.problems)
        what = first.what if count == 1 else f"{first.what}, and {count - 1} more like it"
        fix = "give pictures" + (": these are pointers of Git LFS (git lfs pull)" if _is_pointer(session) else "")
        raise refusal(str(session.path), "images", what, fix, "pictures") from None


def _is_pointer(session: SessionFolder) -> bool:
    """Whether the first picture is a pointer that Git LFS leaves where the file was not fetched."""
    try:
        return read_regular(Path(session.document.views[0].image or ""), 1000).startswith(b"version https://git-lfs")
    except OSError:
        return False


def _missing(problem: Problem) -> str:
    """In how many pictures the target was not found, and the first reason."""
    reasons = [view.missing[1] for view in problem.views if view.missing is not None]
    return f"; not found in {len(reasons)} of {len(problem.views)} pictures: {reasons[0]}" if reasons else ""


def _are_clouds(images: Sequence[Path]) -> bool:
    return bool(images) and all(image.suffix.lower() in CLOUDS for image in images)


def _target(request: ImportRequest, imported: ImportedSet) -> TargetDocument | None:
    if request.target is not None or imported.target is None:
        return request.target
    return target_of_data(imported.target, f"{request.folder}: target")


def _camera(request: ImportRequest, imported: ImportedSet, images: Sequence[Path]) -> CameraDocument | None:
    intrinsics = request.camera or imported.camera
    if intrinsics is None or not images or _are_clouds(images):
        return None
    if request.camera is None and not intrinsics.has_distortion:
        return None
    return intrinsics.document(None if intrinsics.image_size else _size(images[0]))


def _size(image: Path) -> tuple[int, int] | None:
    try:
        height, width = read_grey(image).shape
    except ImageError:
        return None
    return width, height


def _camera_poses(table: PoseTable) -> Array:
    """camera_T_target (n, 4, 4). Raises DocumentError when its convention is not stated."""
    conventions = table.conventions()
    if len(conventions) != 1:
        what = f"{len(conventions)} conventions are possible for {table.layout}"
        raise refusal(table.origin, "camera's poses", what, "write qw, qx, qy, qz or matrices", "pose-pairs")
    try:
        return table.poses(conventions[0], table.unit or "mm", "base_T_flange")
    except GeometryError as error:
        raise refusal(table.origin, "camera's poses", str(error), "correct it", "pose-pairs") from None


def _readings(request: ImportRequest, imported: ImportedSet, *, is_scan: bool) -> list[Reading]:
    table = imported.poses
    setup = request.setup or imported.setup or ("eye-in-hand" if is_scan else None)
    conventions = request.conventions
    if conventions is not None and table.convention is not None and conventions != (table.convention,):
        conventions = (table.convention,)  # the file states it: quaternions with names, matrices
    elif conventions is not None:
        conventions = tuple(one for one in conventions if one.kind == table.kind)
        if not conventions:
            asked = ", ".join(one.name for one in request.conventions or ())
            what = f"{asked} does not fit {table.layout}"
            raise refusal(table.origin, "--convention", what, "leave it out to have all tried", "conventions")
        for convention in conventions:
            _require_rotations(table, convention)
    elif is_scan and table.convention is None and table.kind == "angles":
        raise refusal(table.origin, "--convention", "missing, and clouds without a target do not decide it", "give it",
                      "conventions")  # fmt: skip
    if request.unit is not None and table.unit is None:
        table.require_reach(request.unit, "--unit")
    frame = request.frame or ("base_T_flange" if is_scan and table.frame is None else None)
    setups = SETUPS if setup is None else (setup,)
    return readings_of(table, setups, conventions, table.unit or request.unit, frame)


def _require_rotations(table: PoseTable, convention: Convention) -> None:
    try:
        table.poses(convention, "mm", "base_T_flange")
    except GeometryError as error:
        what = f"{error} as {convention.name}"
        raise refusal(table.origin, "poses", what, "correct the file, or give another --convention") from None


def _document(
    images: Sequence[Path],
    seen: Array | None,
    target: TargetDocument | None,
    camera: CameraDocument | None,
    unit: LengthUnit | None,
    request: ImportRequest,
) -> SessionDocument:
    """A session whose robot poses are yet unknown: the identity in every view."""
    still = PoseDocument.of(np.eye(4))
    if seen is not None:
        views = [ViewDocument(base_T_flange=still, camera_T_target=PoseDocument.of(pose)) for pose in seen]
    elif _are_clouds(images):
        views = [
            ViewDocument(base_T_flange=still, cloud=str(image), unit=require_cloud_unit(unit, request))
            for image in images
        ]
    else:
        views = [ViewDocument(base_T_flange=still, image=str(image)) for image in images]
    return SessionDocument(schema_version=1, setup="eye-in-hand", target=target, camera=camera, views=views)


def _undecided(table: PoseTable, readings: Sequence[Reading], decision: Decision, missing: str) -> Undecided:
    setups = {reading.setup for reading in decision.choices or readings}
    frames = {reading.frame for reading in decision.choices or readings}
    conventions = {reading.convention.name for reading in decision.choices or readings}
    asked = []
    if len(setups) > 1:
        asked.append("--setup eye-in-hand (the camera on the flange) or eye-to-hand (the camera beside the robot)")
    elif len(frames) > 1:
        asked.append("--frame base_T_flange or flange_T_base")
    if len(conventions) > 1:
        names = sorted(conventions)
        others = f" or another of {len(names)}" if len(names) > 6 else ""
        asked.append(f"--convention {', '.join(names[:6])}{others}")
    if not asked:
        asked.append("the right target and pairs; or --convention, --unit, --frame and --setup to import it as it is")
    error = refusal(table.origin, "poses", decision.words + missing, f"give {'; and '.join(asked)}", "conventions")
    return Undecided(error.origin, error.problems)
