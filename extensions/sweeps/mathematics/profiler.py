"""X and the clock offset of a line profiler from sweeps over spheres and planes, as a Solution."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calibration.errors import UndeterminedError
from calibration.sentences.sentence import Sentence
from calibration.solution import ClockOffsetDocument, Noise, Solution, ViewResult
from calibration.transforms import Array
from extensions.sweeps.mathematics.profile_features import find_plane, find_sphere
from extensions.sweeps.mathematics.profile_solver import FIX, ProfilerProblem, ProfilerSolution, SweepPoints, refine
from extensions.sweeps.mathematics.profile_start import MAX_OFFSET_S, find_start
from registration.calibrate.outcome import solution_with_x, solution_without_x
from registration.errors import PathGap, ProfileError, RegistrationError
from registration.points.rigid_motion import RigidMotion
from registration.profiles.profile_block import ProfileBlock
from registration.profiles.robot_path import MAX_GAP_S, RobotPath

METHOD = "sweeps of a line profiler"
MIN_SWEEPS = 3
SEEN_POINTS = 200


@dataclass(frozen=True, eq=False)
class ArtefactSweep:
    """A sweep over one artefact that stands in base: its name, and the radius of a sphere, None of a plane.

    face : 0 of the left and 1 of the right face of an edge; the two sweeps of an edge have one block and one path.
    """

    block: ProfileBlock
    path: RobotPath
    artefact: str
    radius_mm: float | None
    face: int | None = None


def solve_profiler(sweeps: Sequence[ArtefactSweep], rough: Array | None = None) -> Solution:
    """X of the profiler's frame as `mount_T_camera`, and `clock_offset`; both None when they are not determined.

    Profiles that are taken while the arm stands, on a sphere or planes, determine X and no clock.

    A sweep without its artefact is rejected with a reason. `rough`: X (4, 4) to begin with, else it is searched.
    Raises MotionError for a rough X that is none, and ProfileError for an artefact of two radii.
    """
    if rough is not None:
        RigidMotion.of(rough, "mm")
    # Names in their order, and radii. Raises ProfileError.
    radii: dict[str, float | None] = {}
    for sweep in sweeps:
        if radii.setdefault(sweep.artefact, sweep.radius_mm) != sweep.radius_mm:
            raise ProfileError(f"the artefact {sweep.artefact!r} has two radii", "give each artefact a name of its own")
    found: dict[int, SweepPoints] = {}
    reasons: dict[int, str] = {}
    for index, sweep in enumerate(sweeps):
        try:
            found[index] = _find_artefact(sweep)
        except RegistrationError as error:
            reasons[index] = f"artefact-not-found: {error}"
    paths = [sweeps[index].path for index in found]
    middles = np.array([path.base_T_flange[len(path.times_s) // 2] for path in paths]).reshape(-1, 4, 4)
    try:
        answer, seen_mm = _solve(sweeps, found, radii, rough)
    except (UndeterminedError, PathGap) as error:
        results = [_view(index, reasons.get(index, error.code), None) for index in range(len(sweeps))]
        refusal = (
            error if isinstance(error, UndeterminedError) else UndeterminedError(error.code, error.what, error.fix)
        )
        return solution_without_x(METHOD, "eye-in-hand", results, middles, refusal)
    errors_mm = dict(zip(found, answer.residual_mm.tolist(), strict=True))
    clock = ClockOffsetDocument(answer.estimate.clock_offset_s, float(np.sqrt(answer.covariance[6, 6])))
    return solution_with_x(
        METHOD, "eye-in-hand", answer.estimate.flange_T_profiler, answer.covariance[:6, :6], seen_mm,
        Noise(None, answer.robot.rotation_rad, answer.robot.translation_mm),
        [_view(index, reasons.get(index), errors_mm.get(index)) for index in range(len(sweeps))], middles,
        clock_offset=None if all(sweeps[index].path.stands for index in found) else clock,
    )  # fmt: skip


def _solve(
    sweeps: Sequence[ArtefactSweep],
    found: dict[int, SweepPoints],
    radii_mm: dict[str, float | None],
    rough: Array | None,
) -> tuple[ProfilerSolution, Array]:
    """The answer, and places (n, 3) in the profiler frame at which points were measured.

    Raises UndeterminedError, PathGap.
    """
    if len(found) < MIN_SWEEPS:
        raise UndeterminedError("too-few-sweeps", Sentence("profiler-sweeps", sweeps=len(found)), FIX)
    used = [name for name in radii_mm if any(sweeps[index].artefact == name for index in found)]
    each = [replace(one, surface=used.index(sweeps[index].artefact)) for index, one in found.items()]
    start = find_start(each, [radii_mm[name] for name in used], rough)
    paths = [*{id(sweep.path): sweep.path for sweep in each}.values()]
    of = np.array([next(at for at, path in enumerate(paths) if path is sweep.path) for sweep in each])
    whole = [_together([sweep for sweep in each if sweep.path is path]) for path in paths]  # one error of the arm
    answer = refine(ProfilerProblem(whole), replace(start, errors=np.zeros((len(whole), 6))))
    for sweep in whole:
        sweep.path.at(sweep.times_s + answer.estimate.clock_offset_s, np.inf if sweep.path.stands else MAX_GAP_S)
    seen_mm = np.concatenate([one.points_mm[:: len(one.points_mm) // SEEN_POINTS + 1] for one in each])
    return replace(answer, residual_mm=answer.residual_mm[of]), seen_mm


def _together(sweeps: Sequence[SweepPoints]) -> SweepPoints:
    """The points of one path on all their surfaces."""
    surfaces = [np.broadcast_to(sweep.surface, len(sweep.points_mm)) for sweep in sweeps]
    points, times = (np.concatenate([getattr(one, name) for one in sweeps]) for name in ("points_mm", "times_s"))
    return SweepPoints(points, times, sweeps[0].path, np.concatenate(surfaces))


def _find_artefact(sweep: ArtefactSweep) -> SweepPoints:
    """Raises ProfileError, SphereError."""
    block, path = sweep.block, sweep.path
    if len(block) and not (
        path.times_s[0] - MAX_OFFSET_S <= block.times_s[0] and block.times_s[-1] <= path.times_s[-1] + MAX_OFFSET_S
    ):
        what = f"profiles from {block.times_s[0]:.3f} to {block.times_s[-1]:.3f} s and poses from {path.times_s[0]:.3f}"
        raise ProfileError(
            f"{what} to {path.times_s[-1]:.3f} s are not of the same time",
            f"give times of clocks that agree within {MAX_OFFSET_S:g} s; what is left is estimated",
        )
    if sweep.radius_mm is None:
        return find_plane(block, path, sweep.face)
    return find_sphere(block, path, sweep.radius_mm)


def _view(index: int, reason: str | None, error_mm: float | None) -> ViewResult:
    """A sweep as a view; `error_mm`: RMS distance of its points from the artefact."""
    return ViewResult(index, None, "used" if reason is None else "rejected", reason, None, error_mm, None)
