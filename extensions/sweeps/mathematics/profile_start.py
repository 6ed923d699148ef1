"""A first X of a line profiler when none is known: 24 rotations, each with the rest by linear least squares."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from calibration.errors import UndeterminedError
from calibration.sentences.sentence import Sentence
from calibration.transforms import Array, rotation_angle_rad, rotation_from_vector, transform
from extensions.sweeps.mathematics.profile_solver import (
    DIFFERENCE_S,
    FIX,
    FittedSurface,
    ProfilerEstimate,
    ProfilerProblem,
    SweepPoints,
    descend,
)
from registration.calibrate.sphere_solver import cube_rotations

COARSE_ITERATIONS, FINE_ITERATIONS = 25, 60
COARSE_POINTS = 120
"""Points of a sweep with which the 24 starts are tried."""
REFINED = 4
TRIED_ROTATIONS, STARTS = 4000, 24
APART_RAD = float(np.radians(10.0))
ALIKE_RATIO, ALIKE_MM = 1.3, 0.02
"""Another X fits as well when its median distance is at most so many times, and so much, larger."""
MIN_FARTHER_RATIO = 2.0
"""Of profiles taken standing with the sphere at one distance, a mirrored X fits as well; it is as much farther away."""
MAX_OFFSET_S = 1.0
"""A first offset beyond it is the linear solution's error."""


def find_start(
    sweeps: Sequence[SweepPoints], radii_mm: Sequence[float | None], rough: Array | None
) -> ProfilerEstimate:
    """The estimate to refine; `rough`: X (4, 4), else it is searched. Raises UndeterminedError when two fit alike."""
    problem = ProfilerProblem([_thinned(sweep, COARSE_POINTS) for sweep in sweeps])
    standing = all(sweep.path.stands for sweep in sweeps)
    if rough is not None:
        rotations = [rough[:3, :3]]
    elif standing and all(radius is None for radius in radii_mm):
        rotations = _rotations_of_lines(sweeps)
    else:
        rotations = cube_rotations()
    tried = []
    for rotation in rotations:
        start = _linear(rotation, sweeps, radii_mm)
        problem.place_s(start.clock_offset_s)
        tried.append(descend(problem, start, COARSE_ITERATIONS))
    tried.sort(key=lambda entry: entry[1])
    starts = [start for start, _ in tried[:REFINED]]
    if standing:  # a mirrored X may fit as well, and all of the best may be that one
        starts = [one for at, (one, _) in enumerate(tried)
                  if all(_angle_rad(one, other) > APART_RAD for other, _ in tried[:at])][:REFINED]  # fmt: skip
    refined = []
    for start in starts:
        estimate = start
        for _ in range(2):
            problem.place_s(estimate.clock_offset_s)
            estimate, median_mm = descend(problem, estimate, FINE_ITERATIONS)
        refined.append((estimate, median_mm))
    refined.sort(key=lambda entry: entry[1])
    best, least_mm = refined[0]
    for other, median_mm in refined[1:]:
        off_rad = _angle_rad(other, best)
        if off_rad > APART_RAD and median_mm < ALIKE_RATIO * least_mm + ALIKE_MM:
            near, far = sorted((best, other), key=lambda one: float(np.linalg.norm(one.flange_T_profiler[:3, 3])))
            distances_mm = [float(np.linalg.norm(one.flange_T_profiler[:3, 3])) for one in (near, far)]
            if standing and distances_mm[1] > MIN_FARTHER_RATIO * distances_mm[0]:
                best = near  # the other one has the light shine back to the flange, from beyond the sphere
                continue
            what = Sentence("profiler-ambiguous", off_deg=float(np.degrees(off_rad)))
            raise UndeterminedError("profiler-ambiguous", what, FIX)
    return best


def _rotations_of_lines(sweeps: Sequence[SweepPoints]) -> list[Array]:
    """Rotations of X, each apart from the others, under which the lines on each plane are nearest to being in a plane.

    A profile taken standing is one line; lines on a plane that are nearly parallel do not show its normal.
    """
    tried = rotation_from_vector(np.random.default_rng(0).uniform(-np.pi, np.pi, (TRIED_ROTATIONS, 3)))
    scatter = np.zeros((TRIED_ROTATIONS, 1 + max(int(sweep.surface) for sweep in sweeps), 3, 3))
    for sweep in sweeps:
        points = sweep.points_mm - sweep.points_mm.mean(axis=0)
        along = tried @ np.linalg.svd(points, full_matrices=False)[2][0] @ sweep.path.base_T_flange[0, :3, :3].T
        scatter[:, sweep.surface] += along[:, :, None] * along[:, None, :]
    kept: list[Array] = []
    for rotation in tried[np.argsort(np.linalg.eigvalsh(scatter)[:, :, 0].sum(axis=1))]:
        if len(kept) < STARTS and all(rotation_angle_rad(rotation.T @ one) > APART_RAD for one in kept):
            kept.append(rotation)
    return kept


def _angle_rad(one: ProfilerEstimate, other: ProfilerEstimate) -> float:
    return float(rotation_angle_rad(one.flange_T_profiler[:3, :3].T @ other.flange_T_profiler[:3, :3]))


def _thinned(sweep: SweepPoints, count: int) -> SweepPoints:
    rows = np.unique(np.linspace(0, len(sweep.times_s) - 1, count).astype(int))
    return replace(sweep, points_mm=sweep.points_mm[rows], times_s=sweep.times_s[rows])


def _linear(rotation: Array, sweeps: Sequence[SweepPoints], radii_mm: Sequence[float | None]) -> ProfilerEstimate:
    """Translation, offset and surfaces that best fit a rotation of X; the offset in 1/100 s beside mm."""
    normals = [
        np.zeros(3) if radius is not None else _plane_normal(rotation, [one for one in sweeps if one.surface == index])
        for index, radius in enumerate(radii_mm)
    ]
    rows, right = [], []
    for sweep in sweeps:
        time_s = sweep.crossing[0] if sweep.crossing else float(np.median(sweep.times_s))
        pose = sweep.path.at(time_s, np.inf, np.inf)
        ends = sweep.path.at(np.array([time_s - DIFFERENCE_S, time_s + DIFFERENCE_S]), np.inf, np.inf)
        row = np.zeros((3, 4 + 3 * len(radii_mm)))
        row[:, :3] = pose[:3, :3]
        row[:, 3] = (ends[1, :3, 3] - ends[0, :3, 3]) / (2 * DIFFERENCE_S) / 100
        own = slice(4 + 3 * sweep.surface, 7 + 3 * sweep.surface)
        if sweep.crossing:
            row[:, own] = -np.eye(3)
            at = pose[:3, :3] @ rotation @ sweep.crossing[1] + pose[:3, 3]
        else:
            normal = normals[sweep.surface]
            at = _placed(rotation, sweep).mean(axis=0)
            row, at = normal[None] @ row, np.array([normal @ at])
            row[:, own] = -normal
        rows.append(row)
        right.append(-at)
    solution = np.linalg.lstsq(np.concatenate(rows), np.concatenate(right), rcond=1e-9)[0]
    surfaces = tuple(
        FittedSurface(place, normal, radius)
        for place, normal, radius in zip(solution[4:].reshape(-1, 3), normals, radii_mm, strict=True)
    )
    offset_s = float(np.clip(solution[3] / 100, -MAX_OFFSET_S, MAX_OFFSET_S))
    return ProfilerEstimate(transform(rotation, solution[:3]), offset_s, surfaces, np.zeros((len(sweeps), 6)))


def _placed(rotation: Array, sweep: SweepPoints) -> Array:
    """Points (k, 3) in base with X's translation and the offset zero."""
    poses = sweep.path.at(sweep.times_s, np.inf, np.inf)
    placed: Array = np.einsum("nij,nj->ni", poses[:, :3, :3], sweep.points_mm @ rotation.T) + poses[:, :3, 3]
    return placed


def _plane_normal(rotation: Array, sweeps: Sequence[SweepPoints]) -> Array:
    """(3,): the direction in which the points of each sweep over one plane scatter least."""
    scatter = np.zeros((3, 3))
    for sweep in sweeps:
        placed = _placed(rotation, sweep)
        scatter += np.cov(placed.T)
    normal: Array = np.linalg.eigh(scatter)[1][:, 0]
    return normal
