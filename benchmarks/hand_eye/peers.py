"""RMS errors of X compared with OpenCV's methods and with the Cramér-Rao bound, at 5, 10, 20 and 50 views.

`python -m benchmarks.hand_eye.peers [--only mixed|poses|pixels] [--cells N] [--methods]`. `mixed`: whole sessions drawn
as in `benchmarks.hand_eye`, of every noise, intrinsics given or not; ten times as many. The others have one noise level
per row. `poses`: sessions given as pairs of poses with isotropic errors of unknown size; `pixels`: whole sessions with
given intrinsics. `--methods` prints every method's errors.
"""

import argparse
import multiprocessing
import os
import warnings
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from itertools import product

import numpy as np

from benchmarks.hand_eye.cells import STATED, bound_of, draw_cell, error_of
from benchmarks.hand_eye.closed_form_peers import Poses, opencv_methods, own, whose
from calibration.errors import UndeterminedError
from calibration.preprocessing.prepare import prepare
from calibration.problem import Setup
from calibration.solve import estimate_session
from calibration.transforms import Array
from tests.simulated.pose_pairs import Motions, PoseNoise, PoseSession, drawn_session
from tests.simulated.sessions import Cell, CellNoise, random_cell
from tests.support.pose_arrays import solve_hand_eye_poses

VIEWS = (5, 10, 20, 50)
BARS = np.array([0.85, 0.65])
"""Goals of the ratio of our error to the best of OpenCV's: rotation, translation."""

POSE_NOISES = (
    PoseNoise(0.02, 0.1, 0.02, 0.1),
    PoseNoise(0.05, 0.05, 0.05, 0.05),
    PoseNoise(0.01, 0.3, 0.01, 0.3),
    PoseNoise(0.02, 0.1, 0.1, 0.5),
    PoseNoise(0.05, 0.3, 0.01, 0.05),
)
MOTIONS: tuple[Motions, ...] = ("looking", "random")
CELL_NOISES = (
    CellNoise(0.02, 0.0, 0.0),
    CellNoise(0.05, float(np.radians(0.005)), 0.05),
    CellNoise(0.05, float(np.radians(0.02)), 0.1),
    CellNoise(0.2, float(np.radians(0.01)), 0.1),
    CellNoise(0.5, float(np.radians(0.05)), 0.5),
)
SETUPS: tuple[Setup, ...] = ("eye-in-hand", "eye-to-hand")
OURS, BOUND, KRONECKER = "handeyed", "bound", "handeyed kronecker"

Squares = dict[str, Array]
"""Squared errors of X by method, [rotation rad², translation mm²]; infinite where there is none."""

Session = Callable[[np.random.Generator, int], Squares]
Found = Mapping[int, Sequence[Squares]]
"""By number of views."""


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cells", type=int, default=200, help="for each row and number of views")
    parser.add_argument("--only", choices=("mixed", "poses", "pixels"), help="one of the tables")
    parser.add_argument("--views", type=int, nargs="+", default=VIEWS)
    parser.add_argument("--workers", type=int, default=os.cpu_count())
    parser.add_argument("--methods", action="store_true", help="print every method below each row")
    options = parser.parse_args()
    print(f"RMS error of X over that of the best of OpenCV's methods; {whose()}")
    print(f"In brackets what the Cramér-Rao bound has; bars {BARS[0]} deg, {BARS[1]} mm")
    with ProcessPoolExecutor(options.workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        if options.only in (None, "mixed"):
            table = Table("images; all cells together", options.views, 10 * options.cells, options.methods)
            every = table.draw(pool, session_squares, 0)
            found = {n: [one for one in sessions if one] for n, sessions in every.items()}
            print("refused for turning about one axis: ", *(len(every[n]) - len(found[n]) for n in every))
            table.line("RMS", found)
            own_bounds = {n: [in_bounds(one) for one in sessions] for n, sessions in found.items()}
            table.line("RMS of each error over its cell's bound", own_bounds, below=False)
        if options.only in (None, "poses"):
            heading = "pairs of poses; motions, noise of the robot, of the camera"
            table = Table(heading, options.views, options.cells, options.methods)
            for row, (motions, noise) in enumerate(product(MOTIONS, POSE_NOISES)):
                table.line(f"{motions:>7}  {noise}", table.draw(pool, partial(pose_squares, noise, motions), row))
            table.total()
        if options.only in (None, "pixels"):
            table = Table("images; setup, noise of pixels and robot", options.views, options.cells, options.methods)
            for row, (setup, level) in enumerate(product(SETUPS, CELL_NOISES)):
                table.line(f"{setup}  {_words(level)}", table.draw(pool, partial(cell_squares, level, setup), row))
            table.total()


class Table:
    """Prints its lines, and counts where the goals are met."""

    def __init__(self, heading: str, views: Sequence[int], sessions: int, methods: bool) -> None:
        self._views, self._sessions, self._methods = views, sessions, methods
        self._within, self._possible, self._all = np.zeros(2, int), np.zeros(2, int), 0
        print(f"\n{heading}; {sessions} sessions a figure (each good to {100 / np.sqrt(3 * sessions):.0f} %)")
        print(f"{'':44}" + "".join(f"{f'{n} views: deg':>16}{'mm':>13}" for n in views))

    def draw(self, pool: ProcessPoolExecutor, session: Session, row: int) -> Found:
        seeds = range(self._sessions)
        return {
            n: list(pool.map(partial(_one, session, n), [(row, n, seed) for seed in seeds], chunksize=5))
            for n in self._views
        }

    def line(self, name: str, found: Found, *, below: bool = True) -> None:
        line, methods = f"{name:<44}", []
        for n in self._views:
            rms = {method: np.sqrt(np.mean([one[method] for one in found[n]], axis=0)) for method in found[n][0]}
            best = np.min([rms[method] for method in rms if method not in (OURS, BOUND, KRONECKER)], axis=0)
            ours, bound = rms[OURS] / best, rms[BOUND] / best
            self._within += ours <= BARS
            self._possible += bound <= BARS
            self._all += 1
            line += f"    {ours[0]:5.2f} ({bound[0]:.2f}) {ours[1]:5.2f} ({bound[1]:.2f})"
            methods += [
                f"    {n} views {method:>20} {np.degrees(each[0]):8.4f} deg {each[1]:8.4f} mm"
                for method, each in rms.items()
            ]
        print("\n".join([line, *(methods if below and self._methods else [])]), flush=True)

    def total(self) -> None:
        within, possible = self._within, self._possible
        print(
            f"met: rotation {within[0]} of {self._all} ({possible[0]} where the bound is that low),"
            f" translation {within[1]} of {self._all} ({possible[1]})"
        )


def _one(session: Session, views: int, seed: tuple[int, ...]) -> Squares:
    return session(np.random.default_rng(seed), views)


def pose_squares(noise: PoseNoise, motions: Motions, rng: np.random.Generator, views: int) -> Squares:
    """Squared errors of one session given as pairs of poses."""
    session = drawn_session(rng, views, noise, motions)
    try:
        ours = solve_hand_eye_poses("eye-in-hand", session.anchor_T_mount, session.camera_T_target).mount_T_camera
    except UndeterminedError:
        ours = np.full((4, 4), np.nan)
    return _squares(session, session, ours, session.bound)


def session_squares(rng: np.random.Generator, views: int) -> Squares:
    """Squared errors of one session with pixels, of any noise and setup; empty for one that ours refuses."""
    cell, noise = draw_cell(rng, views, SETUPS[rng.integers(len(SETUPS))])
    try:
        ours = estimate_session(cell.problem).best.chain.mount_T_camera
    except UndeterminedError:
        return {}
    return _squares(cell, prepare(cell.problem), ours, bound_of(cell, noise).covariance)


def in_bounds(squares: Squares) -> Squares:
    """Errors in units of the session's own bound, so that the noisiest sessions do not dominate."""
    return {method: square / squares[BOUND] for method, square in squares.items()}


def cell_squares(noise: CellNoise, setup: Setup, rng: np.random.Generator, views: int) -> Squares:
    """Squared errors of one session with pixels."""
    cell = random_cell(rng, views, noise, setup=setup, knowledge=STATED)
    ours = estimate_session(cell.problem).best.chain.mount_T_camera
    return _squares(cell, prepare(cell.problem), ours, bound_of(cell, noise).covariance)


def _squares(truth: Cell | PoseSession, poses: Poses, ours: Array, bound: Array) -> Squares:
    variances = np.diagonal(bound)
    found = {OURS: ours}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        found |= {name: method(poses) for name, method in (opencv_methods() | {KRONECKER: own("kronecker")}).items()}
    squares = {BOUND: np.array([variances[:3].sum(), variances[3:].sum()])}
    for name, mount_T_camera in found.items():
        if np.all(np.isfinite(mount_T_camera)):
            error = error_of(truth, mount_T_camera)
            squares[name] = np.array([error[:3] @ error[:3], error[3:] @ error[3:]])
        else:
            squares[name] = np.full(2, np.inf)
    return squares


def _words(noise: CellNoise) -> str:
    if not noise.robot_translation_mm:
        return f"{noise.image_px:g} px, exact robot"
    return f"{noise.image_px:g} px, {np.degrees(noise.robot_rotation_rad):.3g} deg {noise.robot_translation_mm:g} mm"


if __name__ == "__main__":
    main()
