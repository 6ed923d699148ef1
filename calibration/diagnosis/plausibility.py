"""Is this a measurement, and of a cell that can exist? Asked of every solution before its U is believed.

Poses of which one side was computed from the other agree perfectly, with an X that says nothing; a camera metres away
from the flange that carries it, or behind the flange that it looks through, belongs to another reading of the poses.
`CHECKS` is the table of the second kind. The limits of places are judgement, those of circles follow from pixel noise.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from calibration.closed_forms.inverted_poses import ALWAYS_AGREEING
from calibration.closed_forms.observability import SAME_POSE_MM, SAME_POSE_RAD, distinct_stations
from calibration.closed_forms.registry import park, shah
from calibration.diagnosis.convention_hypotheses import MIN_SETUP_RATIO
from calibration.diagnosis.evidence import Evidence, evidence_of
from calibration.errors import UndeterminedError
from calibration.kinematics.robot_accuracy import MAX_POSSIBLE_NOISE
from calibration.linear_algebra import scaled_solve
from calibration.observations.measured_poses import measured_views
from calibration.observations.observations import MOVED_MM, observe
from calibration.observations.pose_model import predicted_camera_T_target
from calibration.observations.view_poses import candidate_poses
from calibration.problem import MOUNTS, MeasuredPose, Problem, anchor_T_mount_of
from calibration.sentences.sentence import Sentence
from calibration.solution import Finding, Noise, Solution, used_views
from calibration.transforms import Array, difference, inverse, map_points, rotation_angle_rad, vector_from_transform

CIRCULAR = "circular-poses"

MAX_IDENTITY_MM, MAX_IDENTITY_RAD = 5.0, float(np.radians(0.5))
"""Median distance from the identity of X and base_T_target together: no base has the target where the robot stands."""

MAX_EXACT_MM, MAX_EXACT_RAD = 1e-3, 2e-6
"""Disagreement, RMS, below the resolution of any controller and any camera."""

MAX_REPEATABILITY_MM = 5e-3
"""Disagreement, RMS, below the repeatability of any robot."""

MIN_NOISY_PX = 1e-3
"""Scatter of corners from which they are a camera's; only computed ones fit better."""

MAX_LOG_PROBABILITY = -20.0
"""Of robot's poses that agree with the images' by chance better than the images' own noise lets any."""

WARNED_MM, REFUSED_MM, FOOT_MM = 500.0, 1000.0, 250.0
"""Distance of what the flange carries from it; and from the base's origin of what would stand in the arm's foot."""

MAX_DISTANCE_RATIO = 1.5
"""Largest ratio of a camera's distance from the flange, where that is beyond WARNED_MM, to the target's from it."""

MIN_SURE_VIEWS = 6
"""Least views that outvote a limit of the camera's distance from the flange."""

MAX_STAND_MM = 7200.0
"""Distance of a standing camera from the base: the reach of the longest arm (4.2 m), and 3 m."""

FLANGE_RADIUS_MM, MIN_STEEPNESS = 25.0, float(np.cos(np.radians(45.0)))
"""Of the smallest flange's face; a camera that looks at it more aslant may look past its edge."""

MOVED_RAD = float(np.radians(0.1))
"""As MOVED_MM, by rotation."""

MAX_BEHIND_SHARE = 0.5
"""Of views in which the target is behind the camera: one or two are wrong measurements."""

SETTLED_BY_GUESS = frozenset({"mount-too-far", "setup-fits-either-way", "flange-in-sight"})
"""Findings that a known place of the camera settles."""


@dataclass(frozen=True, eq=False)
class _Session:
    """The solution with the views that it uses; `noisy_px`: scatter of their corners, None without pictures."""

    problem: Problem
    solution: Solution
    evidence: Evidence
    noisy_px: float | None

    def load_distance_mm(self, mount_T_camera: Array, anchor_T_target: Array, *, camera: bool) -> float:
        """Distance from its frame of the camera, or of the target's centre."""
        if camera:
            return float(np.linalg.norm(mount_T_camera[:3, 3]))
        return float(np.linalg.norm(map_points(anchor_T_target, self.centre_mm)))

    @property
    def centre_mm(self) -> Array:
        """(1, 3) of the target's points."""
        return np.asarray(self.problem.target.points_mm.mean(axis=0, keepdims=True))

    @property
    def behind(self) -> tuple[list[int], float]:
        """Views of poses in space with the target behind the camera, none where few; its median depth in all, mm."""
        depths = map_points(self.evidence.camera_T_target, self.centre_mm)[:, 0, 2]
        views = [int(index) for index in self.evidence.indices[depths < 0]]
        many = self.problem.in_space and len(views) > MAX_BEHIND_SHARE * len(depths)
        return views if many else [], float(np.median(depths))

    @property
    def chain(self) -> tuple[Array, Array] | None:
        """X and the target's pose; None where they are not determined, or robot and images contradict each other."""
        X, Y, noise = self.solution.mount_T_camera, self.solution.anchor_T_target, self.solution.noise
        if (noise.robot_translation_mm or 0.0) > MAX_POSSIBLE_NOISE.translation_mm:
            return None
        return None if X is None or Y is None else (X, Y)


def check_plausibility(problem: Problem, solution: Solution) -> Solution:
    """The solution with the findings of a circle, which has no X and no U, or of `CHECKS`.

    `problem`: as it was solved, with an external axis at its zero.
    """
    session = _session(problem, solution)
    if session is None or not len(session.evidence):
        return solution
    with np.errstate(all="ignore"):  # numbers far from any cell overflow; they are refused as they are
        circle = tuple(_circle(session))
        is_circle = any(finding.severity == "error" for finding in circle)
        places = () if is_circle else tuple(finding for check in CHECKS for finding in check(session))
    solution = replace(solution, findings=(*solution.findings, *circle, *places))
    if not is_circle:
        return solution
    return replace(
        solution, mount_T_camera=None, anchor_T_target=None, uncertainty=None, noise=Noise(),
        hold_out=None, leave_out=None, external_axis=None,
    )  # fmt: skip


def circle_of(evidence: Evidence) -> Finding | None:
    """The finding that the robot's poses are the camera's own, before any X is known; None where they are not."""
    seen = evidence.camera_T_target
    if len(evidence) < ALWAYS_AGREEING:
        return None
    for moved in (evidence.base_T_flange, inverse(evidence.base_T_flange)):
        off_mm, off_rad = _distances(moved @ seen, np.eye(4))
        if np.median(off_mm) <= MAX_IDENTITY_MM and np.median(off_rad) <= MAX_IDENTITY_RAD:
            sizes = {"off_mm": float(np.median(off_mm)), "off_deg": float(np.degrees(np.median(off_rad)))}
            return Finding(CIRCULAR, "error", Sentence("circular-identity", **sizes), Sentence("give-robots-poses"))
    return None


def leave_out_settled(solution: Solution) -> Solution:
    """The solution without the findings that a camera found where it was expected settles."""
    return replace(solution, findings=tuple(one for one in solution.findings if one.code not in SETTLED_BY_GUESS))


def _session(problem: Problem, solution: Solution) -> _Session | None:
    problem = replace(problem, views=used_views(problem, solution))
    if problem.in_space:
        try:
            measured, _ = measured_views(problem)
        except UndeterminedError:
            return None
        indices = np.array([problem.views[position].index for position in measured.positions], np.intp)
        n = len(measured)
        evidence = Evidence(problem.setup, indices, measured.base_T_flange, measured.camera_T_target,
                            np.zeros((n, 6, 6)), np.ones(n))  # fmt: skip
        return _Session(problem, solution, evidence, None)
    camera = problem.camera or solution.camera
    seen, _ = observe(problem)
    if camera is None or not len(seen):
        return None
    evidence = evidence_of(problem, seen, camera, candidate_poses(seen, camera)[0][:, 0])
    assert evidence.pictures is not None
    return _Session(problem, solution, evidence, evidence.pictures.pixel_px)


def _distances(poses: Array, reference: Array) -> tuple[Array, Array]:
    """Distances (n,) of poses (n, 4, 4) from one (4, 4), mm and rad."""
    off = inverse(reference) @ poses
    return np.linalg.norm(off[:, :3, 3], axis=1), rotation_angle_rad(off[:, :3, :3])


def _circle(session: _Session) -> Iterator[Finding]:
    """Poses of which one side was computed from the other."""
    evidence, chain = session.evidence, session.chain
    if (finding := circle_of(evidence)) is not None:
        yield finding
        return
    if chain is None or len(evidence) < ALWAYS_AGREEING:
        return
    fix = Sentence("give-robots-poses")
    moved, seen = evidence.anchor_T_mount(), evidence.camera_T_target
    if session.noisy_px is not None:  # a circle is exact with the intrinsics as given, and with its own X
        X = shah(moved, seen)
        chain = X, (moved @ X @ seen)[0]
    predicted = predicted_camera_T_target(moved, *chain)
    errors = vector_from_transform(seen @ inverse(predicted))
    shift_mm = float(np.sqrt(np.mean(np.sum((seen - predicted)[:, :3, 3] ** 2, axis=1))))
    turn_rad = float(np.sqrt(np.mean(np.sum(errors[:, :3] ** 2, axis=1))))
    if session.noisy_px is None:
        if shift_mm <= MAX_EXACT_MM and turn_rad <= MAX_EXACT_RAD:
            fixed = any(np.max(_distances(pose[None], np.eye(4))) <= MAX_EXACT_MM for pose in chain)
            circular = isinstance(session.problem.views[0].measured, MeasuredPose) and fixed
            sentence = "circular-product" if circular else "exact-poses"
            code, severity = (CIRCULAR, "error") if circular else ("exact-poses", "warning")
            yield Finding(code, severity, Sentence(sentence, off_mm=shift_mm), fix)  # type: ignore[arg-type]
    elif session.noisy_px > MIN_NOISY_PX and shift_mm <= MAX_REPEATABILITY_MM:
        square = float(np.sum(errors * scaled_solve(evidence.covariance, errors[..., None])[..., 0]))
        redundancy = 6 * len(evidence) - 12
        share = max(square / redundancy, 1e-300)
        # Chernoff's bound of a chi-square below `share` times its mean.
        if share < 1 and redundancy / 2 * (np.log(share) + 1 - share) < MAX_LOG_PROBABILITY:
            message = Sentence("circular-residual", off_mm=shift_mm, image_px=session.noisy_px)
            yield Finding(CIRCULAR, "error", message, fix)


def _repeats(session: _Session) -> Iterator[Finding]:
    """Two views with one side equal to the last digit, and the other not; the solver leaves out repeated pictures."""
    robot, seen = session.evidence.base_T_flange, session.evidence.camera_T_target
    robots, cameras = ("robot", robot, seen, MOVED_MM, MOVED_RAD), ("camera", seen, robot, SAME_POSE_MM, SAME_POSE_RAD)
    for side, poses, others, least_mm, least_rad in (robots, cameras) if session.problem.in_space else (robots,):
        first: dict[bytes, int] = {}
        views = []
        for row, pose in enumerate(poses):
            earlier = first.setdefault(pose.tobytes(), row)
            moved_mm, moved_rad = difference(others[earlier], others[row])
            if earlier < row and (moved_mm > least_mm or moved_rad > least_rad):
                views.append(int(session.evidence.indices[row]))
        if views:
            message = Sentence(f"{side}-poses-repeated", views=views)
            yield Finding(f"{side}-poses-repeated", "error", message, Sentence("record-each-pose-anew"))


def _mount(session: _Session) -> Iterator[Finding]:
    """The camera's distance from what carries it."""
    if session.chain is None:
        return
    away_mm = float(np.linalg.norm(session.chain[0][:3, 3]))
    if MOUNTS[session.problem.setup] == "base":
        if away_mm > MAX_STAND_MM:
            message = Sentence("stand-too-far", away_m=away_mm / 1000, most_m=MAX_STAND_MM / 1000)
            yield Finding("stand-too-far", "error", message, Sentence("check-setup-and-units"))
        return
    if away_mm <= WARNED_MM:
        return
    seen_mm = float(np.median(np.linalg.norm(map_points(session.evidence.camera_T_target, session.centre_mm), axis=-1)))
    few = len(session.evidence) < MIN_SURE_VIEWS
    # Inverted on both sides, X is the target's place, and the target's place X. A board's z may point either way.
    poses = isinstance(session.problem.views[0].measured, MeasuredPose) and not session.problem.poses_from_controller
    near_mm = WARNED_MM if session.behind[0] else FOOT_MM * poses
    inverted = float(np.linalg.norm(session.chain[1][:3, 3])) <= near_mm
    refused = inverted or (few and (away_mm > REFUSED_MM or away_mm > MAX_DISTANCE_RATIO * seen_mm))
    message = Sentence("mount-too-far", away_mm=away_mm, target_mm=seen_mm)
    fix = Sentence("look-along-z" if inverted else "check-setup-and-units")
    yield Finding("mount-too-far", "error" if refused else "warning", message, fix)


def _sight(session: _Session) -> Iterator[Finding]:
    """The target behind the camera in most views, or the flange itself before it in every one."""
    behind, depth_mm = session.behind
    if behind:  # an axis that points backwards; inverted on both sides, poses fit as well
        message = Sentence("target-behind-camera", views=behind, depth_mm=-depth_mm)
        yield Finding("target-behind-camera", "warning", message, Sentence("look-along-z"))
    if session.chain is None or MOUNTS[session.problem.setup] == "base":
        return
    flange_T_camera = session.chain[0]
    behind_mm = -float(flange_T_camera[2, 3])
    if behind_mm <= 0:
        return
    sights = map_points(flange_T_camera @ session.evidence.camera_T_target, session.centre_mm)[:, 0]
    sights -= flange_T_camera[:3, 3]
    crossings = flange_T_camera[:3, 3] + sights * (behind_mm / sights[:, 2:])
    steep = sights[:, 2] > np.maximum(MIN_STEEPNESS * np.linalg.norm(sights, axis=1), behind_mm)
    if np.all(steep & (np.linalg.norm(crossings[:, :2], axis=1) < FLANGE_RADIUS_MM)):
        message = Sentence("flange-in-sight", behind_mm=behind_mm)
        yield Finding("flange-in-sight", "error", message, Sentence("check-setup-and-units"))


def _other_setup(session: _Session) -> Iterator[Finding]:
    """Three views whose poses a driver read fit the other setup as well: what the flange carries has to decide.

    (Poses that nobody vouches for are refused by the verdict: `inverted-fits-as-well`.)
    """
    stations = distinct_stations(session.evidence.base_T_flange)
    if session.chain is None or len(stations) > ALWAYS_AGREEING or not session.problem.poses_from_controller:
        return
    evidence = session.evidence.take(np.array(stations, np.intp))
    in_hand = session.problem.setup == "eye-in-hand"
    other = inverse(anchor_T_mount_of(session.problem.setup, evidence.base_T_flange))
    X = park(other, evidence.camera_T_target)
    Y = (other @ X @ evidence.camera_T_target)[0]
    stated_mm = session.load_distance_mm(*session.chain, camera=in_hand)
    other_mm = session.load_distance_mm(X, Y, camera=not in_hand)
    if not other_mm >= MIN_SETUP_RATIO * stated_mm:
        message = Sentence("setup-fits-either-way", stated_mm=stated_mm, other_mm=other_mm)
        yield Finding("setup-fits-either-way", "error", message, Sentence("take-a-fourth-view"))


CHECKS: tuple[Callable[[_Session], Iterator[Finding]], ...] = (_repeats, _mount, _sight, _other_setup)
"""Of a solution that is a measurement."""
