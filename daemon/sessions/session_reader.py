"""Read a calibration session, session.json beside its images, into a Problem.

All faults of the folder are raised together as one DocumentError. A view in which the target is not found is no error:
the Problem holds it with the reason.
"""

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calibration.detection.cloud_points import measure_corners
from calibration.documents.external_axis import UNITS
from calibration.documents.session import FILES, SessionDocument, ViewDocument
from calibration.documents.validation import limit_problems, parse_document, with_heading
from calibration.errors import DetectionError, DocumentError, DocumentProblem
from calibration.problem import Detection, MeasuredPoints, MeasuredPose, Measurement, Problem, View
from calibration.sentences.sentence import with_fix
from calibration.targets import Target
from daemon.runtime.bounded_read import read_document
from daemon.sessions.session_files import SESSION_FILE, TAKE_AGAIN, ImageError, read_grey
from daemon.sessions.view_detection import detect_in_file, explain_missing
from drivers.cameras.pixel_depth import to_8_bit
from registration.io.organised import read_organised

BRIGHT_PERCENTILES = (99.9, 95.0)
"""Grey levels of an intensity without a range of its own that become white, one after the other."""


def view_of_cloud(folder: Path, target: Target, index: int, view: ViewDocument, size: tuple[int, int] | None) -> View:
    """The view with the target's points in space, or with the reason why there are none.

    `size`: width and height, for files that do not hold them. Raises CloudError's leaves, UnitUnknown.
    """
    from calibration.detection.detect import detect  # needed by runs only

    assert view.cloud is not None
    assert view.unit is not None
    cloud = read_organised(folder / view.cloud, view.unit, size)
    failure: DetectionError | None = None
    for image in _exposures(cloud.intensity):
        try:
            return View(
                index, view.stance, None, view.cloud, measured=measure_corners(detect(image, target), cloud.points_mm)
            )
        except DetectionError as error:
            failure = failure or error
    assert failure is not None
    return View(index, view.stance, None, view.cloud, missing=(failure.code, with_fix(failure.what, failure.fix)))


def _exposures(intensity: NDArray[Any]) -> list[NDArray[np.uint8]]:
    """The intensity as uint8: integers by their depth, other numbers by what is bright."""
    if intensity.dtype in (np.uint8, np.uint16):
        return [to_8_bit(intensity)]
    levels = np.nan_to_num(intensity.astype(np.float64), nan=0.0, posinf=0.0, neginf=0.0)
    dark = float(np.percentile(levels, 0.1))
    whites = [float(np.percentile(levels, percentile)) for percentile in BRIGHT_PERCENTILES]
    scaled = [255 * (levels - dark) / max(white - dark, 1e-12) for white in whites]
    return [np.clip(image, 0, 255).astype(np.uint8) for image in scaled]


Progress = Callable[[int, int], None]
"""Called with (views done, views in all), from the calling thread."""


PICTURES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".pgm")
OF_THEIR_SIZE = "give intrinsics found at the pictures' size, or none (null): they are then estimated"
WITHOUT_FILES = "give corners_px, points_mm or camera_T_target, or solve the folder with 'handeyed solve'"


@dataclass(frozen=True)
class SessionFolder:
    """A parsed session.json and the folder of its images."""

    path: Path
    document: SessionDocument

    @property
    def file(self) -> Path:
        return self.path / SESSION_FILE


def open_session(path: Path) -> SessionFolder:
    """The session in folder `path` (or the session.json at `path`). Raises DocumentError."""
    folder = path.parent if path.name == SESSION_FILE else path
    file = folder / SESSION_FILE
    if not folder.is_dir():
        raise DocumentError.one(
            str(folder), "folder", "not there" if not folder.exists() else "not a folder", "check the path"
        )
    if not file.exists() and any(path.suffix.lower() in PICTURES for path in folder.iterdir()):
        fix = f"make one of them and a file of poses: handeyed import {folder} --out SESSION"
        raise DocumentError.one(str(file), "file", "the folder holds pictures, and no session.json", fix)
    document = parse_document(SessionDocument, read_document(file), str(file))
    _require_sound(document, str(file))
    return SessionFolder(folder, document)


def problem_without_files(document: SessionDocument, origin: str) -> Problem:
    """The Problem of a session whose views need no file; `origin` names it in errors. Raises DocumentError."""
    named = [
        DocumentProblem(f"views[{index}].{view.observation}", "a file does not come with a request", WITHOUT_FILES)
        for index, view in enumerate(document.views)
        if view.observation in FILES
    ]
    if named:
        raise DocumentError(origin, limit_problems(named, len(named)))
    _require_sound(document, origin)
    return load_problem(SessionFolder(Path(), document))


def _require_sound(document: SessionDocument, origin: str) -> None:
    """Raises DocumentError with all problems beyond the document's types."""
    if problems := [problem for check in _CHECKS for problem in check(document)]:
        raise DocumentError(origin, with_heading(SessionDocument, problems))


def load_problem(session: SessionFolder, progress: Progress = lambda done, of: None) -> Problem:
    """Detect the target in every image, in up to 8 threads (OpenCV releases the GIL). Raises DocumentError."""
    document, target = session.document, session.document.described_target()
    if document.point_pairs is not None:
        what, fix = "pairs of points have no poses of a target", "solve them with 'handeyed solve'"
        raise DocumentError.one(str(session.file), "views", what, fix)
    if document.in_space:
        return _problem_in_space(session, target, progress)
    stated = document.camera.image_size if document.camera else document.image_size
    seen: dict[int, tuple[View, tuple[int, int] | None]] = {}
    problems: dict[int, DocumentProblem] = {}
    with ThreadPoolExecutor(max_workers=min(os.cpu_count() or 1, 8)) as pool:
        jobs = {
            pool.submit(_detect_view, session.path, target, index, view): index
            for index, view in enumerate(document.views)
        }
        for done, job in enumerate(as_completed(jobs), start=1):
            index = jobs[job]
            try:
                seen[index] = job.result()
            except ImageError as error:
                problems[index] = DocumentProblem(f"views[{index}].image", error.what, error.fix)
            progress(done, len(jobs))
    sizes = {index: size for index, (_, size) in sorted(seen.items()) if size is not None}
    of_all = list(sizes.values())
    expected = stated if stated in of_all else max(of_all, key=of_all.count, default=stated or (0, 0))
    for index, size in sizes.items():
        if size != expected:
            what = f"'{document.views[index].image}' is {_by(size)} pixels where the session has {_by(expected)}"
            problems[index] = DocumentProblem(f"views[{index}].image", what, TAKE_AGAIN)
    found = [problems[index] for index in sorted(problems)]
    if stated and stated != expected:
        what = f"{_by(stated)}, but the pictures are {_by(expected)}"
        found.insert(0, DocumentProblem("camera.image_size" if document.camera else "image_size", what, OF_THEIR_SIZE))
    if found:
        raise DocumentError(str(session.file), with_heading(SessionDocument, found))
    views = [view for _, (view, _) in sorted(seen.items())]
    views = explain_missing(views, target, lambda name: read_grey(session.path / name))
    views = [
        replace(view, camera_temperature_c=taken.camera_temperature_c, arm_temperature_c=taken.arm_temperature_c)
        for view, taken in ((view, document.views[view.index]) for view in views)
    ]
    return problem_of(document, expected, views)


def problem_of(document: SessionDocument, image_size: tuple[int, int], views: Sequence[View]) -> Problem:
    """The solver's Problem, exactly as a session of pictures describes it."""
    return Problem(
        document.setup, document.described_target(), document.camera.camera() if document.camera else None, image_size,
        tuple(views), poses_from_controller=document.poses_from_controller, axis_offset=document.axis_offset,
        external_axis=document.rough_axis, load=document.carried, knowledge=document.known.knowledge(),
        robot_noise=document.noise_belief, poses_of=document.poses_of,
    )  # fmt: skip


def _problem_in_space(session: SessionFolder, target: Target, progress: Progress) -> Problem:
    document, views = session.document, []
    for index, view in enumerate(document.views):
        if view.cloud is not None:
            views.append(view_of_cloud(session.path, target, index, view, document.image_size))
            progress(index + 1, len(document.views))
        else:
            views.append(View(index, view.stance, None, measured=_measurement(view)))
    return Problem(
        document.setup, target, None, document.image_size or (0, 0), tuple(views), in_space=True,
        poses_from_controller=document.poses_from_controller, poses_of=document.poses_of,
        knowledge=document.known.knowledge(),
    )  # fmt: skip


def _measurement(view: ViewDocument) -> Measurement:
    if view.points_mm is not None:
        rows = np.array(view.points_mm, float).reshape(-1, 4)
        return MeasuredPoints(rows[:, 0].astype(np.intp), rows[:, 1:].copy())
    assert view.camera_T_target is not None  # the document holds one of the two
    covariance = None if view.covariance is None else np.array(view.covariance, float)
    return MeasuredPose(view.camera_T_target.transform(), covariance)


def _detect_view(folder: Path, target: Target, index: int, view: ViewDocument) -> tuple[View, tuple[int, int] | None]:
    """One view, and its image's size (None when the session holds the corners)."""
    if view.corners_px is not None:
        rows = np.array(view.corners_px, float).reshape(-1, 3)
        return View(index, view.stance, Detection(rows[:, 0].astype(np.intp), rows[:, 1:].copy())), None
    assert view.image is not None  # the document holds either corners or an image
    found, size = detect_in_file(folder / view.image, target)
    if isinstance(found, DetectionError):
        missing = found.code, with_fix(found.what, found.fix)
        return View(index, view.stance, None, view.image, missing=missing), size
    return View(index, view.stance, found, view.image), size


def find_repeated_poses(document: SessionDocument) -> list[DocumentProblem]:
    """A problem for each view whose pose equals an earlier one to the last digit: probably not read after the move."""
    first: dict[tuple[float, ...], int] = {}
    problems = []
    for index, view in enumerate(document.views):
        pose = (*view.base_T_flange.translation_mm, *view.base_T_flange.quaternion_wxyz)
        earlier = first.setdefault(pose, index)
        if earlier != index:
            what = f"the same as that of views[{earlier}]"
            fix = "read the pose again after each move, or remove one of the two"
            problems.append(DocumentProblem(f"views[{index}].base_T_flange", what, fix))
    return problems


def _check_sizes(document: SessionDocument) -> list[DocumentProblem]:
    camera, size = document.camera, document.image_size
    if camera and size and camera.image_size != size:
        what = f"{_by(size)}, but camera.image_size is {_by(camera.image_size)}"
        return [DocumentProblem("image_size", what, "make them agree, or remove one")]
    if not camera and not size and not document.in_space and all(view.image is None for view in document.views):
        return [DocumentProblem("image_size", "missing, and no image shows it", "add it, or add the camera")]
    return []


def _check_image_names(document: SessionDocument) -> list[DocumentProblem]:
    """Names of images and clouds stay within the session's folder."""
    names = [(index, view.observation, view.image or view.cloud) for index, view in enumerate(document.views)]
    return [
        DocumentProblem(f"views[{index}].{kind}", f"'{name}' is outside the session's folder", "copy it there")
        for index, kind, name in names
        if name is not None and (PurePosixPath(name).is_absolute() or ".." in PurePosixPath(name).parts or "\0" in name)
    ]


def _check_corners(document: SessionDocument) -> list[DocumentProblem]:
    points = len(document.described_target().points_mm)
    problems = []
    for index, view in enumerate(document.views):
        ids = [point[0] for point in view.corners_px or view.points_mm or ()]
        for place, point in enumerate(ids):
            if not 0 <= point < points:
                what, fix = f"the target has no point {point}", f"ids run from 0 to {points - 1}, row by row"
            elif point in ids[:place]:
                what, fix = f"point {point} appears twice", "keep one of them"
            else:
                continue
            problems.append(DocumentProblem(f"views[{index}].{view.observation}[{place}]", what, fix))
    return problems


def _check_observations(document: SessionDocument) -> list[DocumentProblem]:
    """There are views; all hold the same kind of observation, and what those need is described."""
    alike = {"corners_px": "image", "cloud": "points_mm"}
    kinds = dict.fromkeys(alike.get(view.observation, view.observation) for view in document.views)
    problems = []
    if not document.views:
        problems.append(DocumentProblem("views", "there are none", "a calibration needs three views or more"))
    if len(kinds) > 1:
        what = f"they hold {' and '.join(kinds)}"
        problems.append(DocumentProblem("views", what, "give the same in every view, or make two sessions of them"))
    if document.target is None and not {*kinds} <= {"camera_T_target", "camera_point_mm"}:
        problems.append(DocumentProblem("target", "missing", "add it"))
    if "camera_point_mm" in kinds and document.setup == "eye-in-hand":
        what, fix = "a camera on the flange", "give camera_point_mm for a standing camera only, or camera_T_target"
        problems.append(DocumentProblem("setup", what, fix))
    if not document.in_space and "camera" not in document.model_fields_set:
        problems.append(DocumentProblem("camera", "missing", "add it; null to have the intrinsics estimated"))
    without = [index for index, view in enumerate(document.views) if view.covariance is None]
    if 0 < len(without) < len(document.views):
        what, fix = "missing, where other pictures have one", "add it, or leave it out of all"
        problems += [DocumentProblem(f"views[{index}].covariance", what, fix) for index in without]
    return problems


def _check_external_axis(document: SessionDocument) -> list[DocumentProblem]:
    """The axis goes with images, a turntable with a target beside the robot, and every view has its reading."""
    axis = document.external_axis
    if axis is None:
        return []
    if document.in_space:
        fix = "leave it out, and give poses that include the axis"
        return [DocumentProblem("external_axis", "it is found from images only", fix)]
    if axis.kind == "turntable" and document.setup == "eye-to-hand":
        fix = "leave it out: the target is on the flange, and a turntable moves neither it nor the camera"
        return [DocumentProblem("external_axis", "a turntable carries the target, beside the robot", fix)]
    what = f"it holds no axis {axis.number}"
    fix = f"give the reading of the {axis.kind} for every picture, {UNITS[axis.kind]}"
    return [
        DocumentProblem(f"views[{index}].external_axes", what, fix)
        for index in range(len(document.views))
        if document.axis_reading(index) is None
    ]


_CHECKS = (_check_observations, _check_external_axis, _check_sizes, _check_image_names, _check_corners)
"""Checks of a session beyond its types."""


def _by(size: tuple[int, int]) -> str:
    return f"{size[0]} x {size[1]}"
