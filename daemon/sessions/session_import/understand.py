"""Reads a folder, finds the target in its images, and decides how the robot's poses are meant."""

import contextlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path, PurePath
from typing import Self

import numpy as np

from calibration.diagnosis.diagnose import MIN_VIEWS
from calibration.diagnosis.evidence import Evidence
from calibration.diagnosis.fit import Fit
from calibration.diagnosis.plausibility import circle_of
from calibration.documents.imports.pose_table import LARGE_ARM_MM, SMALL_ARM_MM, PoseTable
from calibration.documents.imports.refusal import refusal
from calibration.documents.imports.sets import CLOUDS, ImportedSet, read_set
from calibration.documents.imports.sides import agreeing_conventions, equal_sides
from calibration.documents.pose import PoseDocument
from calibration.documents.readings import Decision, Reading, agreement_of, compare, decide, readings_of
from calibration.documents.session import CameraDocument, SessionDocument, ViewDocument
from calibration.documents.target_text import FORMS, example, target_of_data
from calibration.documents.view_evidence import evidence_of_views
from calibration.errors import DocumentError, GeometryError
from calibration.kinematics.abb_arms import find_arm
from calibration.kinematics.conventions import CONVENTIONS, LENGTH_UNITS, MM, Frame
from calibration.problem import Problem, Setup
from calibration.targets import orientation_advice
from calibration.transforms import Array
from calibration.verdict import tool_findings
from daemon.sessions.pictures import encode_picture
from daemon.sessions.session_files import TAKE_AGAIN, ImageError, read_grey
from daemon.sessions.session_import.folder_files import list_files
from daemon.sessions.session_import.request import ImportRequest, Understood, are_clouds, views_of
from daemon.sessions.session_reader import SessionFolder, load_problem
from registration.io.regular_file import read_regular

Progress = Callable[[int, int], None]

MAX_SIGHTS = 6
"""Conventions of the camera's poses that are compared by the translations as well."""

SETUPS: tuple[Setup, Setup] = ("eye-in-hand", "eye-to-hand")
FRAMES: tuple[Frame, Frame] = ("base_T_flange", "flange_T_base")

MAX_CARRIED_MM, MIN_CARRIED_RATIO = 300.0, 3.0
"""A flange carries nothing farther from it than that, and of readings that fit alike the one that needs it three times
as far is wrong."""

OPTIONS = {"--convention": "conventions unit", "--frame": "frame", "--unit": "unit", "--setup": "setup"}
"""Options without which poses are compared that do not fit as stated, and their fields; a brand states a unit, too."""

SETUP_FIX = "--setup eye-in-hand (the camera on the flange) or eye-to-hand (the camera beside the robot)"
FRAME_FIX = "give --frame base_T_flange (the flange's poses in the base) or flange_T_base"


class Undecided(DocumentError):
    """The data do not decide how the poses are meant; the message names what has to be given."""

    @classmethod
    def by(cls, origin: str, place: str, what: str, fix: str, heading: str = "pose-pairs") -> Self:
        """The error of a place in a file, with the heading of docs/formats.md that describes it."""
        return cls(origin, refusal(origin, place, what, fix, heading).problems)


def understand(request: ImportRequest, progress: Progress = lambda done, of: None) -> Understood:
    """What the folder holds. Raises DocumentError, Undecided."""
    files = list_files(request.folder)
    imported = read_set(files, request.part, request.chosen, request.arm)
    links = (f"{len(files.links)} links are not followed",) if files.links else ()
    within = imported.poses.pictures if request.pictures is not None else ()
    images = [
        (request.pictures or Path()) / name if within else files.path(name).absolute() for name in imported.images
    ]
    for image, picture in zip(images, within, strict=False):
        image.write_bytes(encode_picture(picture, "image/png", None))
    return understand_set(request, replace(imported, notes=(*imported.notes, *links)), images, progress)


def understand_set(
    request: ImportRequest, imported: ImportedSet, pictures: Sequence[Path] = (), progress: Progress = lambda *_: None
) -> Understood:
    """What poses and pictures that were read are. Raises DocumentError, Undecided."""
    if not imported.poses.moves:
        what = f"all {len(imported.poses)} poses are the same"
        raise refusal(imported.poses.origin, "poses", what, "give the pose of the flange at each picture")
    imported, beside = _one_sight(request, imported)
    if imported.poses.kind == "points":
        return _of_points(request, imported)
    images = tuple(pictures) if imported.images else ()
    target = request.target
    if target is None and imported.target is not None:
        target = target_of_data(imported.target, f"{request.folder}: target")
    camera = _camera(request, imported, images)
    if images and target is None and not are_clouds(images):
        forms = ", ".join(example(kind) for kind in list(FORMS)[:3])
        raise refusal(request.folder.name, "target", "not stated by the folder", f"give --target: {forms}", "targets")
    is_scan = bool(images) and target is None

    def evidence_by(seen: Array | None) -> tuple[Evidence | None, Problem | None]:
        if target is None and seen is None:
            return None, None
        still = PoseDocument.of(np.eye(4))  # the robot's poses are yet unknown
        sights = views_of(seen, images, request.cloud_unit or imported.cloud_unit, request)
        views = [ViewDocument(base_T_flange=still, **sight) for sight in sights]
        document = SessionDocument(schema_version=1, setup="eye-in-hand", target=target, camera=camera, views=views)
        problem = _load(SessionFolder(request.folder, document), progress)
        return evidence_of_views(problem), problem

    best = _best(request, imported, evidence_by, is_scan=is_scan)
    table, decision, reading = best.table, best.decision, best.decision.reading
    other, other_fix = ("", "") if best.possible else _other_way(request, imported, best)
    if reading is None:
        if other:
            decision = replace(decision, words=f"none fits as stated; {other}", fix=other_fix)
        raise _undecided(request, replace(best, decision=decision))
    if decision.axis is not None and not images:
        fix = "give the pictures, from which solve finds the axis, or poses that include it"
        raise refusal(table.origin, "external axes", decision.words, fix, "pose-pairs")
    poses = table.poses(reading.convention, reading.unit, reading.frame)
    if best.evidence is not None:
        circle = circle_of(best.evidence.with_robot_poses(poses[best.evidence.indices]))
        if circle is not None:
            raise refusal(table.origin, "poses", circle.message, circle.fix, "pose-pairs")
    unused = imported.camera is not None and camera is None and bool(images) and request.camera is None
    lens = ("the set's intrinsics state no distortion and are not used; --camera uses them",) if unused else ()
    doubt, reach_mm = "", table.reach_mm(reading.unit)
    least_mm = SMALL_ARM_MM if reading.unit == "mm" else 0.0
    if request.unit is None and table.unit is None and not least_mm <= reach_mm <= LARGE_ARM_MM:
        doubt = (
            f"lengths without a unit are taken as {reading.unit}, which puts the flange {reach_mm:.3g} mm from its base"
        )
        doubt = f"{doubt}; were they cm, name the columns x_cm, y_cm, z_cm"
    camera_unit = request.camera_unit or (imported.camera_poses and imported.camera_poses.unit)
    if doubt and imported.camera_poses is not None and camera_unit is None:  # neither side says how large all is
        fix = f"name the unit of both sides, or give --unit {reading.unit} if they are {reading.unit}"
        raise Undecided.by(table.origin, "unit", doubt, fix)
    still = [label for label, pose in zip(table.labels, poses, strict=True) if np.allclose(pose, np.eye(4))]
    own = (f"pose {still[0]} is the identity: are the poses relative to it, and not to the base?",) if still else ()
    imported, is_unseen = replace(imported, poses=table), best.evidence is None and bool(best.missing)
    unseen = (f"the poses are not compared with the pictures{best.missing}",) if is_unseen else ()
    of_tool = (str(one.message) for one in tool_findings(table.poses_of, reading.setup))
    notes = (
        *table.notes, *of_tool, *imported.notes, *beside, *best.sight.notes,
        *_of_axes_and_options(request, imported, decision),
        *filter(None, [doubt, other and f"{other}: {other_fix}"]), *own, *unseen, *lens,
    )  # fmt: skip
    seen = best.sight.poses
    return Understood(request, imported, reading, decision, poses, seen, images, target, camera, notes)


def _of_points(request: ImportRequest, imported: ImportedSet) -> Understood:
    """Pairs of points of a standing camera, in units that make them one rigid body. Raises DocumentError."""
    robot, camera = imported.poses, imported.camera_poses
    if camera is None:
        what = "3 numbers a row: points of one side"
        raise refusal(robot.origin, "rows", what, "give poses, or points of both sides")
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
    reading = Reading("eye-to-hand", CONVENTIONS["points"], unit, "base_T_flange")
    poses, seen = robot.poses(CONVENTIONS["points"], unit, "base_T_flange"), camera.lengths * MM[of_camera]
    decision = Decision(reading, "of a standing camera; the points themselves show how well they agree")
    return Understood(
        request, imported, reading, decision, poses, None, (), None, None, (*robot.notes, note), camera_points_mm=seen
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
class _Sight:
    """The camera's poses (n, 4, 4) in one reading; `frame` as in `sides.Relation`. None where there are pictures."""

    poses: Array | None = None
    frame: Frame = "base_T_flange"
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class _Best:
    """The table, the camera's poses and the evidence with which the likeliest reading was found."""

    table: PoseTable
    readings: Sequence[Reading]
    decision: Decision
    evidence: Evidence | None
    problem: Problem | None
    sight: _Sight
    fit: Fit | None
    possible: bool

    @property
    def missing(self) -> str:
        """In how many pictures the target was not found, and the first reason."""
        views = [] if self.problem is None else self.problem.views
        reasons = [view.missing[1] for view in views if view.missing is not None]
        return f"; not found in {len(reasons)} of {len(views)} pictures: {reasons[0]}" if reasons else ""

    @property
    def advice(self) -> str | None:
        """What to do about a target that looks the same turned by 180 degrees; else None."""
        return None if self.problem is None else orientation_advice(self.problem.target)

    @property
    def words(self) -> str:
        """Both directions and X, of a decided reading."""
        reading, fit = self.decision.reading, self.fit
        assert reading is not None and fit is not None
        name = "flange_T_camera" if reading.setup == "eye-in-hand" else "base_T_camera"
        x, y, z = fit.mount_T_camera[0, :3, 3]
        seen = "camera_T_target" if self.sight.frame == "base_T_flange" else "target_T_camera"
        return f"{reading.frame} with {seen}: {name} = ({x:.1f}, {y:.1f}, {z:.1f}) mm"

    @property
    def carried_mm(self) -> tuple[float, float]:
        """Distance from the flange of what it carries; and in the reading in which it carries what is in the base."""
        reading, fit = self.decision.reading, self.fit
        assert reading is not None and fit is not None
        chain = (fit.mount_T_camera, fit.anchor_T_target)[:: 1 if reading.setup == "eye-in-hand" else -1]
        carried, other = (float(np.linalg.norm(pose[0, :3, 3])) for pose in chain)
        return carried, other

    def noting(self, note: str) -> Self:
        return replace(self, sight=replace(self.sight, notes=(*self.sight.notes, note)))

    @property
    def rank(self) -> tuple[bool, float]:
        return self.decision.reading is not None, -np.inf if self.fit is None else self.fit.log_likelihood


def _best(
    request: ImportRequest,
    imported: ImportedSet,
    evidence_by: Callable[[Array | None], tuple[Evidence | None, Problem | None]],
    *,
    is_scan: bool,
) -> _Best:
    """The likeliest of the robot's tables and of the readings of the camera's poses. Raises DocumentError."""
    tables = [imported.poses]
    if request.arm is not None and imported.poses.may_be_joints():
        six = np.concatenate([imported.poses.lengths, imported.poses.numbers], axis=1)
        joints = replace(
            imported.poses, lengths=np.zeros((len(six), 3)), numbers=six, kind="joints", unit="mm",
            frame="base_T_flange", arm=find_arm(request.arm), layout="six joints a row",
        )  # fmt: skip
        tables.append(joints)
    sights = [_Sight()] if imported.camera_poses is None else _sights(request, imported)
    found: dict[Frame, list[_Best]] = {}
    for sight in sights:
        evidence, problem = evidence_by(sight.poses)
        for table in tables:
            readings = _readings(request, table, imported.setup, is_scan=is_scan)
            compared = compare(table, readings, evidence, _points_mm(problem))
            fit, possible = (compared[0].fit, compared[0].possible) if compared else (None, False)
            one = _Best(table, readings, decide(table, compared, evidence), evidence, problem, sight, fit, possible)
            if possible and compared[0].turned:
                one = one.noting(f"the target looks the same turned by 180 deg, and is in some pictures: {one.advice}")
            found.setdefault(sight.frame, []).append(one)
    best = _of_sense(request, imported, [max(each, key=lambda one: one.rank) for each in found.values()])
    seen = imported.camera_poses
    is_open = seen is not None and imported.poses.side is None and best.decision.reading is not None
    if seen is None or not is_open or best.fit is None or _decides(*best.carried_mm):
        return best
    named = replace(imported, poses=replace(seen, side="robot", camera=None), camera_poses=imported.poses)
    other = _best(request, named, evidence_by, is_scan=is_scan)
    other = other.noting("the camera's poses stand before the robot's in the file")
    fitting = [best, *[other] * (other.decision.reading is not None)]
    fix = "name both sides in the file, such as robot and camera"
    return _carried_nearest(fitting, "no name says whose the poses are, and exchanged sides fit as well", fix)


def _other_way(request: ImportRequest, imported: ImportedSet, best: _Best) -> tuple[str, str]:
    """What else makes the poses fit, and what to do: without an option, or with an estimated camera; "" for nothing."""
    if best.evidence is None or best.problem is None:
        return "", ""
    ways: list[tuple[str, str, ImportRequest, Evidence]] = []
    for option, names in OPTIONS.items():
        if getattr(request, names.split()[0]) is not None:
            asked = replace(request, **dict.fromkeys(names.split()))  # type: ignore[arg-type]
            ways.append((f"without {option}", f"leave {option} out, or give what fits", asked, best.evidence))
    camera, estimated = request.camera or imported.camera, evidence_of_views(replace(best.problem, camera=None))
    if camera is not None and best.problem.camera is not None and estimated is not None:
        fix = "leave --camera out" if request.camera else "take it out of the folder"
        fix = f"{camera.origin} is of another camera, focus or picture size: {fix}"
        ways.append(("with intrinsics estimated from the pictures", fix, request, estimated))
    for words, fix, asked, evidence in ways:
        readings = _readings(asked, best.table, imported.setup, is_scan=False)
        nearest = next(iter(compare(best.table, readings, evidence, _points_mm(best.problem))), None)
        if nearest is not None and nearest.fit is not None and nearest.possible:
            return f"{words} they agree to {agreement_of(nearest.fit, nearest.readings[0])}", fix
    return "", ""


def _points_mm(problem: Problem | None) -> Array | None:
    """The points (k, 3) of a target in pictures that looks the same turned; else None."""
    return None if problem is None or orientation_advice(problem.target) is None else problem.target.points_mm


def _decides(carried_mm: float, other_mm: float) -> bool:
    """Whether what a flange carries decides between two readings that differ in what it carries."""
    return other_mm > max(MAX_CARRIED_MM, MIN_CARRIED_RATIO * carried_mm)


def _carried_nearest(fitting: Sequence[_Best], why: str, fix: str) -> _Best:
    """Of readings that fit alike the one whose flange carries what is near to it. Raises Undecided without one."""
    near, *others = sorted(fitting, key=lambda one: one.carried_mm)
    if others and not _decides(near.carried_mm[0], others[0].carried_mm[0]):
        what = f"{why}: {' or '.join(one.words for one in fitting)}"
        raise Undecided.by(near.table.origin, "names", what, fix)
    return near.noting(f"{why}; taken, as what a flange carries is near to it, is {near.words}") if others else near


def _of_sense(request: ImportRequest, imported: ImportedSet, found: Sequence[_Best]) -> _Best:
    """The one whose directions the names allow. Raises Undecided where the names allow several.

    Both sides inverted fit as well as neither, with X and the target's pose exchanged.
    """
    best, camera = max(found, key=lambda one: one.rank), imported.camera_poses
    fitting = [one for one in found if one.decision.reading is not None and one.possible]
    if camera is None or not fitting:
        return best
    if request.frame is not None or best.table.frame is not None:
        if len({one.decision.reading.setup for one in fitting if one.decision.reading}) == 1:
            return best
        raise Undecided.by(best.table.origin, "names", " or ".join(one.words for one in fitting), f"give {SETUP_FIX}")
    if imported.poses.side and not camera.named_frames and best.decision.reading and _decides(*best.carried_mm[::-1]):
        what = f"{best.words}; with sides or directions other than their names say, what it carries would be near to it"
        fix = "name both, such as base_T_flange and camera_T_target or target_T_camera; or give --frame if it is right"
        raise Undecided.by(best.table.origin, "names", what, fix)
    allowed = _senses(imported.poses, camera)
    by_frame = {one.decision.reading.frame: one for one in sorted(fitting, key=lambda one: one.rank)}  # type: ignore[union-attr]
    if live := [one for frame, one in by_frame.items() if (frame, one.sight.frame) in allowed]:
        return _carried_nearest(live, "the names may be meant in two directions, and both fit", FRAME_FIX)
    said = " or ".join(dict.fromkeys(frame for frame, _ in allowed))
    carried = sorted(
        (far, side) for one in fitting for far, side in zip(one.carried_mm, ("robot", "camera"), strict=True)
    )
    ways = " or ".join(
        f"the {side}'s inverted (the flange carries what is {far:.0f} mm from it)" for far, side in carried
    )
    what = f"the names say {said} of the robot's poses, which does not fit; likeliest first, {ways} fits"
    fix = "rename the side that is inverted, such as R_cam2target; compare --setup; or give --frame"
    raise Undecided.by(best.table.origin, "names", what, fix)


def _senses(robot: PoseTable, camera: PoseTable) -> set[tuple[Frame, Frame]]:
    """The directions of the robot's and the camera's poses that their names allow; one file speaks in one sense."""
    ours, seen = robot.named_frames, camera.named_frames or ("base_T_flange",)
    if ours and (robot.opencv or camera.opencv):
        return {(ours[0], seen[0])}
    if len(ours) == len(seen) == 2:
        return {*zip(ours, seen, strict=True)}
    return {*product(ours or FRAMES, seen)}


def _sights(request: ImportRequest, imported: ImportedSet) -> list[_Sight]:
    """The camera's poses in each reading whose rotations agree about best with the robot's, with a note."""
    robot, table = imported.poses, imported.camera_poses
    assert table is not None
    conventions = table.conventions()
    if request.camera_conventions is not None and table.convention is None:
        conventions = tuple(one for one in request.camera_conventions if one.kind == table.kind) or conventions
    if len(conventions) > 1:
        allowed = request.conventions if request.conventions is not None else robot.conventions()
        _, _, conventions = agreeing_conventions(robot, table, allowed, conventions)
    units = (request.camera_unit,) if request.camera_unit is not None else table.units()
    frames = (table.frame,) if table.frame else table.named_frames or FRAMES[:1]
    found = []
    for convention, unit, frame in product(conventions[:MAX_SIGHTS], units, frames):
        inverted = ", target_T_camera" if frame == "flange_T_base" else ""
        note = f"the camera's poses: {convention.name}, {unit}{inverted}, {table.layout}"
        try:
            found.append(_Sight(table.poses(convention, unit, frame), frame, (note,)))
        except GeometryError as error:
            raise refusal(table.origin, "camera's poses", str(error), "correct it", "pose-pairs") from None
    if not found:
        what = f"no convention makes {table.layout} rotations"
        raise refusal(table.origin, "camera's poses", what, "write qw, qx, qy, qz or matrices", "pose-pairs")
    return found


def _of_axes_and_options(request: ImportRequest, imported: ImportedSet, decision: Decision) -> Iterator[str]:
    """What to say of external axes that move, and of options that were not used."""
    table = imported.poses
    said = [f"external axis {number} moves from {one.min():g} to {one.max():g}" for number, one in table.varying_axes()]
    kept = "kept as external_axes; a track or turntable that the poses leave out is described by external_axis"
    if said:
        written = "written as external_axis, which solve finds more exactly"
        yield f"{'; '.join(said)}: {kept if decision.axis is None else written}"
    seen, pictures = imported.camera_poses is not None, bool(imported.images)
    rows = (
        ("--arm", request.arm, table.kind == "joints", "the file holds poses"),
        ("--unit", request.unit, table.unit in (None, request.unit), f"the file says {table.unit}"),
        ("--convention", request.conventions, table.convention in (None, *(request.conventions or ())),
         f"the file says {table.convention and table.convention.name}"),
        ("--camera-unit", request.camera_unit, seen, "the camera's poses are not"),
        ("--camera-convention", request.camera_conventions, seen, "the camera's poses are not"),
        ("--target", request.target, pictures, "there are no pictures"),
        ("--camera", request.camera, pictures, "there are no pictures"),
        ("--cloud-unit", request.cloud_unit, {PurePath(one).suffix for one in imported.images} & CLOUDS, "no clouds"),
        ("--part", request.part, table.parts or imported.kind not in ("folder", "samples of pose pairs"),
         "the set has no parts"),
    )  # fmt: skip
    yield from (f"{option} is not used: {why}" for option, given, used, why in rows if given is not None and not used)


def _load(session: SessionFolder, progress: Progress) -> Problem:
    """The problem of a session. Raises DocumentError with one problem, however many pictures have it."""
    try:
        return load_problem(session, progress)
    except DocumentError as error:
        first, count = error.problems[0], len(error.problems)
        what = first.what if count == 1 else f"{first.what}, and {count - 1} more like it"
        fix = first.fix.partition(" (docs/")[0].replace(TAKE_AGAIN, "take it again, or leave it out with its pose")
        fix = "give the pictures: these are pointers of Git LFS (git lfs pull)" if _is_pointer(session) else fix
        place = "--camera" if first.place.startswith("camera") else "images"
        raise refusal(str(session.path), place, what, fix, "pictures") from None


def _is_pointer(session: SessionFolder) -> bool:
    """Whether the first picture is a pointer that Git LFS leaves where the file was not fetched."""
    try:
        return read_regular(Path(session.document.views[0].image or ""), 1000).startswith(b"version https://git-lfs")
    except OSError:
        return False


def _camera(request: ImportRequest, imported: ImportedSet, images: Sequence[Path]) -> CameraDocument | None:
    intrinsics = request.camera or imported.camera
    if intrinsics is None or not images or are_clouds(images):
        return None
    if request.camera is None and not intrinsics.has_distortion:
        return None
    size: tuple[int, int] | None = None
    if not intrinsics.image_size:
        with contextlib.suppress(ImageError):
            height, width = read_grey(images[0]).shape
            size = width, height
    return intrinsics.document(size)


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
            try:
                table.poses(convention, "mm", "base_T_flange")
            except GeometryError as error:
                fix = "correct the file, or give another --convention"
                raise refusal(table.origin, "poses", f"{error} as {convention.name}", fix) from None
    elif is_scan and table.convention is None and table.kind == "angles":
        raise refusal(table.origin, "--convention", "missing, and clouds without a target do not decide it", "give it",
                      "conventions")  # fmt: skip
    if request.unit is not None and table.unit is None:
        table.require_reach(request.unit, "--unit")
    named = table.named_frames or FRAMES[: 1 if is_scan else 2]
    is_said = len(named) == 1 and table.frame is None and (is_scan or len(table) < MIN_VIEWS)
    frame = request.frame or (named[0] if is_said else None)
    setups = SETUPS if setup is None else (setup,)
    return readings_of(table, setups, conventions, table.unit or request.unit, frame)


def _undecided(request: ImportRequest, best: _Best) -> Undecided:
    table, decision, choices = best.table, best.decision, best.decision.choices or best.readings
    conventions = {reading.convention.name for reading in choices}
    asked, words = [], f"{decision.words}{best.missing}"
    if len({reading.setup for reading in choices}) > 1:
        asked.append(SETUP_FIX)
    elif len({reading.frame for reading in choices}) > 1:
        asked.append("--frame base_T_flange or flange_T_base")
    if len(conventions) > 1:
        names = sorted(conventions)
        others = f" or another of {len(names)}" if len(names) > 6 else ""
        asked.append(f"--convention {', '.join(names[:6])}{others}")
    if not asked:
        asked.append("the right target and pairs; or --convention, --unit, --frame and --setup to import it as it is")
    if best.missing and (best.evidence is None or len(best.evidence) == 0):
        asked, words = ["the target that is in the pictures by --target"], f"the target is{best.missing[1:]}"
    fix = decision.fix or (None if best.possible else best.advice) or f"give {'; and '.join(asked)}"
    if not best.possible and best.advice is not None:
        words += "; the target looks the same turned by 180 deg, and may be so in half of the pictures"
    if decision.words.startswith("none fits"):
        words += f" (read from {table.layout})"
    if decision.words.startswith("none fits") and not decision.fix and table.may_be_joints() and request.arm is None:
        words += "; six numbers that are no place: these look like joint angles"
        fix = "give the arm of joints by --arm (`handeyed arms` lists them)"
    return Undecided.by(table.origin, "poses", words, fix, "conventions")
