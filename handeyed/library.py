"""What `import handeyed` gives; thin over the rooms."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self, get_args

import numpy as np
from numpy.typing import ArrayLike

from calibration.documents.arm import ArmErrorsDocument
from calibration.documents.calibration import CalibrationDocument, calibration_document
from calibration.documents.calibration_in_use import CalibrationInUse
from calibration.documents.exports.formats import export as export_x
from calibration.documents.exports.subject import DEFAULT_DECIMALS, OPTICAL_FRAME, ExportOptions
from calibration.documents.imports.leaves import table_of_data
from calibration.documents.imports.pose_files import read_poses
from calibration.documents.imports.sets import ImportedSet
from calibration.documents.plan import PlanDocument, PlannedDocument, PredictedDocument
from calibration.documents.requirement import MAX_TOLERANCE_MM, VerdictSettings
from calibration.documents.session import CameraDocument
from calibration.documents.target import TargetFile
from calibration.documents.validation import validate_document, validate_json
from calibration.errors import DocumentError, UndeterminedError
from calibration.kinematics.conventions import Frame
from calibration.kinematics.stance import Stance
from calibration.pose_pairs.point_pairs import judge_point_pairs, solve_point_pairs
from calibration.problem import Detection, MeasuredPose, Problem, Setup, View
from calibration.solve import poses_at_zero, solve_hand_eye
from calibration.targets import TrackedFrame
from calibration.transforms import Array, inverse, map_points
from calibration.verdict import judge
from daemon.runtime.bounded_read import read_document
from daemon.runtime.clock import Clock, time_ordered_id
from daemon.runtime.version import SOFTWARE
from daemon.sessions.session_import.request import ImportRequest
from daemon.sessions.session_import.understand import understand_set
from daemon.sessions.session_reader import load_problem, open_session
from handeyed.arrays import as_points, as_pose
from registration.io.reading import open_cloud

MM = {"mm": 1.0, "m": 1000.0}


@dataclass(frozen=True, eq=False)
class Session:
    """The views of one calibration. Make one with `open`, `of_corners`, `of_poses` or `of_points`."""

    problem: Problem
    point_pairs: tuple[Array, Array] | None = None

    def __post_init__(self) -> None:
        if self.problem.setup not in get_args(Setup):
            what, fix = f"{self.problem.setup!r} is no set-up", f"say {' or '.join(map(repr, get_args(Setup)))}"
            raise DocumentError.one("Session", "setup", what, fix)

    @classmethod
    def open(cls, folder: str | Path, progress: Callable[[int, int], None] = lambda done, of: None) -> Self:
        """A folder with session.json; pictures are searched for the target, `progress` gets (done, of).

        Raises DocumentError for a file that cannot be used.
        """
        session = open_session(Path(folder))
        if (pairs := session.document.point_pairs) is not None:
            return cls.of_points(*pairs)
        return cls(load_problem(session, progress))

    @classmethod
    def of_corners(
        cls,
        base_T_flange: ArrayLike,
        corners_px: Sequence[ArrayLike],
        target: dict[str, Any],
        *,
        image_size: tuple[int, int],
        ids: Sequence[ArrayLike] | None = None,
        camera_matrix: ArrayLike | None = None,
        distortion: ArrayLike | None = None,
        setup: Setup = "eye-in-hand",
    ) -> Self:
        """Poses (n, 4, 4) in mm and, for each, the target's points (m, 2) in pixels (the centre of the first is 0, 0).

        ids : indices (m,) of the points in the target's order; by default all points in order.
        target : as in session.json, such as {"kind": "chessboard", "columns": 9, "rows": 6, "pitch_mm": 23.6}.
        image_size : width, height.
        camera_matrix, distortion : (3, 3) and OpenCV's coefficients; without them the intrinsics are estimated.

        Raises DocumentError for a target that is none, or for arrays that do not go together.
        """
        poses = np.asarray(base_T_flange, float)
        if poses.ndim != 3 or poses.shape[1:] != (4, 4) or len(poses) != len(corners_px):
            what = f"{poses.shape} poses and {len(corners_px)} pictures do not go together"
            raise DocumentError.one("of_corners", "base_T_flange", what, "give (n, 4, 4) and n arrays")
        known = validate_json(TargetFile, {"target": target}, "of_corners").target
        pixels = [np.asarray(corners, float).reshape(-1, 2) for corners in corners_px]
        which = [np.arange(len(each)) for each in pixels] if ids is None else [np.ravel(each) for each in ids]
        last = len(known.points_mm) - 1
        if [*map(len, which)] != [*map(len, pixels)] or not all(np.all((each >= 0) & (each <= last)) for each in which):
            what = f"numbers of points do not go with the corners, or are beyond 0 to {last}"
            raise DocumentError.one("of_corners", "ids", what, "give the number of each corner in the target's order")
        views = tuple(
            View(index, Stance(pose), Detection(numbers.astype(np.intp), corners))
            for index, (pose, corners, numbers) in enumerate(zip(poses, pixels, which, strict=True))
        )
        camera = None
        if camera_matrix is not None:
            lens = np.zeros(5) if distortion is None else np.asarray(distortion, float).ravel()
            given = {"matrix": camera_matrix, "distortion": lens, "image_size": image_size}
            lists = {name: np.asarray(array).tolist() for name, array in given.items()}
            camera = validate_document(CameraDocument, lists, "of_corners").camera()
        return cls(Problem(setup, known, camera, image_size, views))

    @classmethod
    def of_poses(cls, base_T_flange: ArrayLike, camera_T_target: ArrayLike, *, setup: Setup = "eye-in-hand") -> Self:
        """Poses (n, 4, 4) in mm of the robot, and the target's in the camera, as `solvePnP` or a tracker gives them.

        Of OpenCV's `calibrateHandEye` these are gripper2base and target2cam; for a standing camera, too, give
        base_T_flange and not its inverse. Raises DocumentError for arrays that do not go together.
        """
        poses, seen = np.asarray(base_T_flange, float), np.asarray(camera_T_target, float)
        if poses.ndim != 3 or poses.shape[1:] != (4, 4) or poses.shape != seen.shape:
            what = f"{poses.shape} poses of the robot and {seen.shape} of the camera do not go together"
            raise DocumentError.one("of_poses", "base_T_flange", what, "give (n, 4, 4) of both")
        pairs = enumerate(zip(poses, seen, strict=True))
        views = tuple(View(index, Stance(pose), None, measured=MeasuredPose(other)) for index, (pose, other) in pairs)
        return cls(Problem(setup, TrackedFrame(), None, (0, 0), views, in_space=True))

    @classmethod
    def of_points(
        cls,
        robot_mm: ArrayLike,
        camera_mm: ArrayLike,
        *,
        setup: Setup = "eye-to-hand",
        base_T_flange: ArrayLike | None = None,
    ) -> Self:
        """Points (n, 3) in mm that a tip touched or a ball had, in the robot's base and in the camera's frame.

        base_T_flange : the arm's poses (n, 4, 4) when a camera on the flange saw them; it needs them.
        Raises DocumentError for arrays that do not go together.
        """
        points, seen = np.asarray(robot_mm, float), np.asarray(camera_mm, float)
        if points.ndim != 2 or points.shape[1] != 3 or points.shape != seen.shape:
            what = f"{points.shape} points of the robot and {seen.shape} of the camera do not go together"
            raise DocumentError.one("of_points", "robot_mm", what, "give (n, 3) of both")
        if setup == "eye-in-hand":
            poses = np.zeros((0, 4, 4)) if base_T_flange is None else np.asarray(base_T_flange, float)
            if poses.shape != (len(points), 4, 4):
                what = "a camera on the flange needs the arm's pose at each point"
                raise DocumentError.one("of_points", "base_T_flange", what, "give (n, 4, 4)")
            points = map_points(inverse(poses), points[:, None])[:, 0]
        return cls(Problem(setup, TrackedFrame(), None, (0, 0), (), in_space=True), (points, seen))


Solvable = Session | str | Path | Mapping[str, Any]


def solve(
    session: Solvable,
    *,
    tolerance_mm: float | None = None,
    method: str = "auto",
    setup: Setup | None = None,
    frame: Frame | None = None,
) -> CalibrationDocument:
    """The calibration: X with its covariance, U at the points that matter, noise, views, findings and verdict.

    session : a Session; a folder with session.json; or pairs of poses of robot and camera in a file that `handeyed
        import` reads, a mapping of arrays such as R_gripper2base, t_gripper2base, R_target2cam, t_target2cam, or an
        opened .npz. `setup` says where the camera is then ("eye-in-hand" without it), and `frame` which poses the
        robot's are, where neither names nor evidence decide.
    tolerance_mm : the largest U (k = 2) that is accepted; 1 mm without it.
    method : "auto" (maximum likelihood) or a closed form ("tsai", "park", ...).

    `result.flange_T_camera.transform()` is X (4, 4) in mm; None, with the reason in `result.verdict.findings`, where
    the motions do not determine it. `result.model_dump_json()` is calibration.json. Raises DocumentError, TypeError.
    """
    if tolerance_mm is not None and not 0 < tolerance_mm <= MAX_TOLERANCE_MM:
        raise DocumentError.one("solve", "tolerance_mm", f"{tolerance_mm} mm is no tolerance", "give U in mm")
    known, limits = _session_of(session, setup, frame), VerdictSettings().limits(tolerance_mm)
    if known.point_pairs is not None:
        try:
            solution = solve_point_pairs(known.problem.setup, *known.point_pairs)
        except UndeterminedError as why:
            raise DocumentError.one("of_points", "points", why.what, why.fix) from None
        verdict = judge_point_pairs(solution, limits)
    else:
        solution = solve_hand_eye(known.problem, method=method)
        verdict = judge(poses_at_zero(known.problem, solution), solution, limits)
    clock = Clock()
    return calibration_document(
        solution,
        verdict,
        calibration_id=time_ordered_id(clock),
        created_at=clock.timestamp(),
        software=SOFTWARE,
        target=known.problem.target,
    )


def _session_of(given: Any, setup: Setup | None, frame: Frame | None) -> Session:
    """The session that `solve` is given. Raises DocumentError, TypeError."""
    if isinstance(given, Session):
        return given
    if isinstance(given, str | Path) and Path(given).is_dir():
        return Session.open(given)
    if isinstance(given, str | Path):
        table, origin = read_poses(Path(given).name, read_document(Path(given))), str(given)
    elif isinstance(given, Mapping):
        origin = "solve"
        table = table_of_data({str(name): np.asarray(given[name], float) for name in given}, origin)
    else:  # what the types do not allow, but a caller may give
        what = f"solve takes a Session, a folder, a file or a mapping of arrays, not {type(given).__name__}"
        raise TypeError(f"{what}: make one with Session.of_corners, of_poses or of_points")
    if table.camera is None:
        fix = "give the robot's and the camera's, such as R_gripper2base and R_target2cam"
        raise DocumentError.one(origin, "poses", "only one side's poses", fix)
    request = ImportRequest(Path(origin), setup=setup or table.setup or "eye-in-hand", frame=frame)
    read = understand_set(request, ImportedSet("pairs", table, camera_poses=table.camera))
    if read.camera_points_mm is not None:
        return Session.of_points(read.base_T_flange[:, :3, 3], read.camera_points_mm)
    assert read.camera_T_target is not None
    return Session.of_poses(read.base_T_flange, read.camera_T_target, setup=read.reading.setup)


def plan(question: dict[str, Any]) -> PlannedDocument:
    """The robot poses that determine the calibration best; `question` as plan.json: target, camera, guesses, limits.

    `[pose.base_T_flange.transform() for pose in answer.poses]` are the poses. Raises DocumentError.
    """
    return validate_json(PlanDocument, question, "plan").choose_poses()


def assess(question: dict[str, Any], base_T_flange: ArrayLike) -> PredictedDocument:
    """The standard deviation of X that a calibration from poses (n, 4, 4) will have, before anything moves.

    Its `point_mm` is None where the poses do not determine X. Raises DocumentError.
    """
    return validate_json(PlanDocument, question, "assess").assess(np.asarray(base_T_flange, float))


def register(
    points_mm: ArrayLike,
    calibration: CalibrationDocument,
    base_T_flange: ArrayLike | None = None,
    *,
    joints_deg: ArrayLike | None = None,
    external_axes: Sequence[float | None] | None = None,
    arm: ArmErrorsDocument | None = None,
) -> Array:
    """Points (n, 3) of the camera's frame in the robot's base (n, 3), mm.

    base_T_flange : the arm's pose (4, 4) when they were measured; needed for a camera on the flange.
    joints_deg : (6,) the arm's axes then; with `arm`, whose errors are needed at them.
    external_axes : the controller's axes beside the arm then, mm or degrees; where the calibration has one.
    arm : what is in arm.json, where the arm's errors were identified with the calibration.

    Raises DocumentError for a calibration without X, or without the pose that it needs, for arrays that are no points
    or no pose, and as `CalibrationInUse.base_T_flange`.
    """
    given, points = CalibrationInUse.of(calibration, arm), as_points(points_mm)
    calibration = given.document
    if calibration.base_T_camera is not None:
        return map_points(calibration.base_T_camera.transform(), points)
    if calibration.flange_T_camera is None or base_T_flange is None:
        what = "the calibration has no transform" if base_T_flange is not None else "the pose of the flange is missing"
        raise DocumentError.one("register", "base_T_flange", what, "give what is missing")
    joints = None if joints_deg is None else np.asarray(joints_deg, float).tolist()
    axes = None if external_axes is None else tuple(external_axes)
    (pose,) = given.base_T_flange([Stance.of_degrees(as_pose(base_T_flange), joints, axes)])
    base_T_camera = pose @ calibration.flange_T_camera.transform()
    return map_points(base_T_camera, points)


def read_cloud(file: str | Path, *, unit: str) -> Array:
    """The points (n, 3) of a PLY, PCD, LAS or XYZ file in mm; points that are not finite are left out.

    unit : of the file's lengths, "mm" or "m"; it is never guessed. Raises RegistrationError, DocumentError.
    """
    if unit not in MM:
        raise DocumentError.one("read_cloud", "unit", f"{unit!r} is no unit", "say 'mm' or 'm'")
    with open_cloud(Path(file)) as cloud:
        blocks = [np.column_stack([block[axis] for axis in "xyz"]).astype(float) for block in cloud.blocks()]
    points = np.concatenate(blocks) if blocks else np.empty((0, 3))
    return np.asarray(points[np.isfinite(points).all(axis=1)] * MM[unit])


def export(
    calibration: CalibrationDocument,
    name: str,
    *,
    parent: str | None = None,
    child: str = OPTICAL_FRAME,
    decimals: int = DEFAULT_DECIMALS,
) -> bytes:
    """X as a file of another system: "ros-tf", "urdf", "rapid", "opencv", "halcon", ... (docs/exports.md).

    Raises ExportRefused for an unknown name, or without X.
    """
    return export_x(calibration, name, ExportOptions(parent, child, decimals))
