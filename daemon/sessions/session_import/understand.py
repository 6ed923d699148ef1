"""Reads a folder, finds the target in its images, and decides how the robot's poses are meant."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import numpy as np

from calibration.diagnosis.convention_hypotheses import MIN_SETUP_RATIO
from calibration.diagnosis.evidence import Evidence
from calibration.diagnosis.fit import Fit
from calibration.diagnosis.plausibility import circle_of
from calibration.documents.imports.number_tables import POINTS
from calibration.documents.imports.pairs import agreeing_conventions, equal_sides
from calibration.documents.imports.pose_table import PoseTable
from calibration.documents.imports.refusal import refusal
from calibration.documents.imports.sets.folder import CLOUDS, ImportedSet
from calibration.documents.imports.sets.kinds import read_set
from calibration.documents.pose import PoseDocument
from calibration.documents.readings import Decision, Reading, compare, decide, readings_of
from calibration.documents.session import CameraDocument, SessionDocument, ViewDocument
from calibration.documents.target import TargetDocument
from calibration.documents.target_text import FORMS, example, target_of_data
from calibration.documents.view_evidence import evidence_of_views
from calibration.errors import DocumentError, GeometryError
from calibration.kinematics.abb_arms import find_arm
from calibration.kinematics.conventions import LENGTH_UNITS, MM, Convention, LengthUnit
from calibration.problem import Problem, Setup
from calibration.transforms import Array
from daemon.sessions.session_files import ImageError, read_grey
from daemon.sessions.session_import.folder_files import FolderFiles
from daemon.sessions.session_import.request import ImportRequest, Understood, require_cloud_unit
from daemon.sessions.session_reader import SessionFolder, load_problem
from registration.io.regular_file import read_regular

Progress = Callable[[int, int], None]

MAX_SIGHTS = 6
"""Conventions of the camera's poses that are compared by the translations as well."""

SETUPS: tuple[Setup, Setup] = ("eye-in-hand", "eye-to-hand")


class Undecided(DocumentError):
    """The data do not decide how the poses are meant; the message names what has to be given."""


def understand(request: ImportRequest, progress: Progress = lambda done, of: None) -> Understood:
    """What the folder holds. Raises DocumentError, Undecided."""
    files = FolderFiles.of(request.folder)
    imported = read_set(files, request.part, request.chosen, request.arm)
    _require_motion(imported.poses)
    imported, beside = _one_sight(request, imported)
    if imported.poses.kind == "points":
        return _of_points(request, imported)
    images = tuple(files.path(name).absolute() for name in imported.images)
    target = _target(request, imported)
    camera = _camera(request, imported, images)
    if images and target is None and not _are_clouds(images):
        forms = ", ".join(example(kind) for kind in list(FORMS)[:3])
        raise refusal(request.folder.name, "target", "not stated by the folder", f"give --target: {forms}", "targets")
    is_scan = bool(images) and target is None

    def evidence_by(seen: Array | None) -> tuple[Evidence | None, str]:
        if target is None and seen is None:
            return None, ""
        document = _document(images, seen, target, camera, request.cloud_unit or imported.cloud_unit, request)
        problem = _load(SessionFolder(request.folder, document), progress)
        return evidence_of_views(problem), _missing(problem)

    best = _best(request, imported, evidence_by, is_scan=is_scan)
    table, decision, reading = best.table, best.decision, best.decision.reading
    if reading is None:
        raise _undecided(request, best)
    is_open = request.frame is None and table.frame is None
    if best.seen is not None and is_open and table.named_frame not in (None, reading.frame):
        what = (
            f"the names say {table.named_frame} of the robot's poses, and beside the camera's only {reading.frame} fits"
        )
        raise refusal(
            table.origin, "names", what, "say which side is inverted by its name, or give --frame", "pose-pairs"
        )
    poses = table.poses(reading.convention, reading.unit, reading.frame)
    _require_two_sides(table, best.evidence, poses)
    unused = imported.camera is not None and camera is None and bool(images) and request.camera is None
    lens = ("the set's intrinsics state no distortion and are not used; --camera uses them",) if unused else ()
    links = (f"{len(files.links)} links are not followed",) if files.links else ()
    doubt = table.doubtful_reach(reading.unit) if request.unit is None else ""
    still = [label for label, pose in zip(table.labels, poses, strict=True) if np.allclose(pose, np.eye(4))]
    own = (f"pose {still[0]} is the identity: are the poses relative to it, and not to the base?",) if still else ()
    missing = best.missing
    unseen = (f"the poses are not compared with the pictures{missing}",) if best.evidence is None and missing else ()
    notes = (
        *table.notes, *imported.notes, *beside, *best.notes, *_of_axes(table, decision),
        *_of_options(request, table), *filter(None, [doubt]), *own, *unseen, *lens, *links,
    )  # fmt: skip
    return Understood(
        request, replace(imported, poses=table), reading, decision.words, poses, best.seen, images, target, camera,
        notes, decision.track,
    )  # fmt: skip


def _of_points(request: ImportRequest, imported: ImportedSet) -> Understood:
    """Pairs of points of a standing camera, in units that make them one rigid body. Raises DocumentError."""
    robot, camera = imported.poses, imported.camera_poses
    assert camera is not None
    if request.setup == "eye-in-hand":
        what = "pairs of points of a camera on the flange"
        raise refusal(robot.origin, "--setup", what, "give the arm's pose at each: handeyed.Session.of_points")
    units = [
        (mine, its)
        for mine in ([request.unit] if request.unit else robot.units())
        for its in ([request.camera_unit] if request.camera_unit else [mine, *({*LENGTH_UNITS} - {mine})])
    ]
    ratio = float(np.std(robot.lengths)) / max(float(np.std(camera.lengths)), 1e-12)
    unit, of_camera = min(units, key=lambda pair: abs(np.log(max(ratio, 1e-12) * MM[pair[0]] / MM[pair[1]])))
    note = f"the camera's points: {of_camera}, {camera.layout}"
    reading = Reading("eye-to-hand", POINTS, unit, "base_T_flange")
    poses, seen = robot.poses(POINTS, unit, "base_T_flange"), camera.lengths * MM[of_camera]
    words = "of a standing camera; the points themselves show how well they agree"
    return Understood(
        request, imported, reading, words, poses, None, (), None, None, (*robot.notes, note), camera_points_mm=seen
    )


def _one_sight(request: ImportRequest, imported: ImportedSet) -> tuple[ImportedSet, tuple[str, ...]]:
    """The set with pictures or the camera's poses, not both, and a note of what is left out. Raises DocumentError."""
    table, seen = imported.poses, imported.camera_poses
    if request.axes is not None:
        order = ["xyz".index(axis[-1]) for axis in request.axes]
        signs = [-1.0 if axis[0] == "-" else 1.0 for axis in request.axes]
        imported = replace(imported, poses=replace(table, lengths=table.lengths[:, order] * signs))
    if seen is None:
        return imported, ()
    if imported.images and (request.target is not None or imported.target is not None):
        note = f"the camera's poses ({seen.layout}) are not used: the pictures are"
        return replace(imported, camera_poses=None), (note,)
    if equal_sides(table, seen):
        what = f"the robot's poses ({table.layout}) and the camera's are the same numbers"
        raise refusal(table.origin, "pairs", what, "give the poses that the robot reported", "pose-pairs")
    return replace(imported, images=()), ()


@dataclass(frozen=True, eq=False)
class _Best:
    """The table, the camera's poses and the evidence with which the likeliest reading was found."""

    table: PoseTable
    readings: Sequence[Reading]
    decision: Decision
    evidence: Evidence | None
    missing: str
    seen: Array | None = None
    notes: tuple[str, ...] = ()
    fit: Fit | None = None

    @property
    def rank(self) -> tuple[bool, float]:
        return self.decision.reading is not None, -np.inf if self.fit is None else self.fit.log_likelihood


def _best(
    request: ImportRequest,
    imported: ImportedSet,
    evidence_by: Callable[[Array | None], tuple[Evidence | None, str]],
    *,
    is_scan: bool,
) -> _Best:
    """The likeliest of the robot's tables and of the readings of the camera's poses. Raises DocumentError."""
    tables = [imported.poses]
    if request.arm is not None and imported.poses.may_be_joints():
        tables.append(imported.poses.as_joints(find_arm(request.arm)))
    if imported.camera_poses is None:
        sights: list[tuple[Array | None, tuple[str, ...]]] = [(None, ())]
    else:
        sights = _sights(request, imported)
    found = []
    for seen, notes in sights:
        evidence, missing = evidence_by(seen)
        for table in tables:
            readings = _readings(request, table, imported.setup, is_scan=is_scan)
            compared = compare(table, readings, evidence)
            decision = decide(table, compared, evidence)
            fit = compared[0].fit if compared else None
            found.append(_Best(table, readings, decision, evidence, missing, seen, notes, fit))
    best = max(found, key=lambda one: one.rank)
    if _are_exchanged(imported, best):
        assert imported.camera_poses is not None
        poses, seen_table = imported.camera_poses, imported.poses
        exchanged = replace(imported, poses=replace(poses, side="robot", camera=None), camera_poses=seen_table)
        note = "the camera's poses stand before the robot's in the file"
        best = _best(request, exchanged, evidence_by, is_scan=is_scan)
        return replace(best, notes=(*best.notes, note))
    return best


def _are_exchanged(imported: ImportedSet, best: _Best) -> bool:
    """Whether sides that no name distinguishes stand the other way round: what the flange carries is nearer to it.

    Exchanged sides fit as well, with the inverse of the target's pose for X.
    """
    sides_open = imported.camera_poses is not None and imported.poses.side is None and best.decision.reading is not None
    if not sides_open or best.fit is None or best.decision.reading is None:
        return False
    lengths = [float(np.linalg.norm(pose[0, :3, 3])) for pose in (best.fit.mount_T_camera, best.fit.anchor_T_target)]
    carried, other = lengths if best.decision.reading.setup == "eye-in-hand" else lengths[::-1]
    return carried > MIN_SETUP_RATIO * other


def _sights(request: ImportRequest, imported: ImportedSet) -> list[tuple[Array | None, tuple[str, ...]]]:
    """The camera's poses (n, 4, 4) in each reading whose rotations agree about best with the robot's, with a note."""
    robot, table = imported.poses, imported.camera_poses
    assert table is not None
    conventions = table.conventions()
    if request.camera_conventions is not None and table.convention is None:
        conventions = tuple(one for one in request.camera_conventions if one.kind == table.kind) or conventions
    if len(conventions) > 1:
        allowed = request.conventions if request.conventions is not None else robot.conventions()
        _, _, conventions = agreeing_conventions(robot, table, allowed, conventions)
    units = (request.camera_unit,) if request.camera_unit is not None else table.units()
    frame = table.frame or table.named_frame or "base_T_flange"
    found: list[tuple[Array | None, tuple[str, ...]]] = []
    for convention, unit in product(conventions[:MAX_SIGHTS], units):
        inverted = ", target_T_camera" if frame == "flange_T_base" else ""
        note = f"the camera's poses: {convention.name}, {unit}{inverted}, {table.layout}"
        try:
            found.append((table.poses(convention, unit, frame), (note,)))
        except GeometryError as error:
            raise refusal(table.origin, "camera's poses", str(error), "correct it", "pose-pairs") from None
    if not found:
        what = f"no convention makes {table.layout} rotations"
        raise refusal(table.origin, "camera's poses", what, "write qw, qx, qy, qz or matrices", "pose-pairs")
    return found


def _of_axes(table: PoseTable, decision: Decision) -> tuple[str, ...]:
    """What to say of external axes that move."""
    said = [f"external axis {number} moves from {one.min():g} to {one.max():g}" for number, one in table.varying_axes()]
    if not said:
        return ()
    if decision.track is not None:
        return (f"{'; '.join(said)}: written as external_axis, whose direction solve refines",)
    return (
        f"{'; '.join(said)}: kept as external_axes; a track that the poses leave out is described by external_axis",
    )


def _of_options(request: ImportRequest, table: PoseTable) -> tuple[str, ...]:
    """Options that were not used."""
    rows = (("--arm", request.arm, table.kind == "joints", "the file holds poses"),
            ("--camera-unit", request.camera_unit, table.camera, "there are no camera's poses"))  # fmt: skip
    return tuple(f"{option} is not used: {why}" for option, given, user, why in rows if given is not None and not user)


def _require_motion(table: PoseTable) -> None:
    """Raises DocumentError when all poses of several are the same."""
    numbers = np.concatenate([table.lengths, table.numbers], axis=1)
    if len(numbers) > 1 and np.all(numbers == numbers[0]):
        what = f"all {len(numbers)} poses are the same"
        raise refusal(table.origin, "poses", what, "give the pose of the flange at each picture")


def _require_two_sides(table: PoseTable, evidence: Evidence | None, base_T_flange: Array) -> None:
    """Raises DocumentError when the robot's poses are the camera's own."""
    if evidence is None:
        return
    finding = circle_of(evidence.with_robot_poses(base_T_flange[evidence.indices]))
    if finding is not None:
        raise refusal(table.origin, "poses", finding.message, finding.fix, "pose-pairs")


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


def _readings(request: ImportRequest, table: PoseTable, stated: Setup | None, *, is_scan: bool) -> list[Reading]:
    setup = request.setup or stated or ("eye-in-hand" if is_scan else None)
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


def _undecided(request: ImportRequest, best: _Best) -> Undecided:
    table, decision, choices = best.table, best.decision, best.decision.choices or best.readings
    setups = {reading.setup for reading in choices}
    frames = {reading.frame for reading in choices}
    conventions = {reading.convention.name for reading in choices}
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
    if best.missing and (best.evidence is None or len(best.evidence) == 0):
        asked = ["the target that is in the pictures by --target"]
    fix = decision.fix or f"give {'; and '.join(asked)}"
    words = f"{decision.words}{best.missing}"
    if decision.words.startswith("none fits"):
        words += f" (read from {table.layout})"
    if decision.words.startswith("none fits") and table.may_be_joints() and request.arm is None:
        words += "; six numbers that are no place: these look like joint angles"
        fix = "give the arm of joints by --arm (`handeyed arms` lists them)"
    error = refusal(table.origin, "poses", words, fix, "conventions")
    return Undecided(error.origin, error.problems)
