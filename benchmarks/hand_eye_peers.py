"""RMS errors of X beside OpenCV's methods and beside the bound that no estimator can beat, at 5, 10, 20 and 50 views.

`python -m benchmarks.hand_eye_peers [--cells N]`: N cells for each number of views and each setup, drawn from the
distribution of `benchmarks.cells`, and a quarter as many for each of the single mixes of noise. The RMS of plain
errors is that of the noisiest cells; beside it stands that of errors in units of each cell's bound, where all count.
"""

import argparse
import warnings
from collections.abc import Iterator
from itertools import product

import numpy as np

from benchmarks.cells import bound_of, drawn_cell, error_of
from benchmarks.closed_form_peers import opencv_methods, own, whose
from benchmarks.simulation import Cell, CellNoise, random_cell
from calibration.prepare import prepare
from calibration.problem import Setup
from calibration.solve import estimated
from calibration.transforms import Array

VIEWS = (5, 10, 20, 50)
SETUPS: tuple[Setup, ...] = ("eye-in-hand", "eye-to-hand")
BARS = np.array([0.85, 0.65])
"""Ours over the best of OpenCV's: rotation, translation."""

MIXES = (
    ("0.02 px, exact robot", CellNoise(0.02, 0.0, 0.0)),
    ("0.05 px, 0.005 deg, 0.05 mm", CellNoise()),
    ("0.05 px, 0.02 deg, 0.1 mm", CellNoise(0.05, float(np.radians(0.02)), 0.1)),
    ("0.2 px, 0.01 deg, 0.1 mm", CellNoise(0.2, float(np.radians(0.01)), 0.1)),
    ("0.5 px, 0.05 deg, 0.5 mm", CellNoise(0.5, float(np.radians(0.05)), 0.5)),
)
OURS, BOUND, KRONECKER = "handeyed", "bound", "handeyed kronecker"
Table = dict[str, Array]
"""By method: RMS [rotation deg, translation mm], and RMS [rotation, translation] in units of each cell's bound."""


def main() -> None:
    """The distribution first, method by method; then the mixes, ours against the best."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cells", type=int, default=40, help="cells for each number of views and setup")
    options = parser.parse_args()
    print(f"RMS error of X; {whose()}\n")
    print(f"{options.cells} cells a row of 0.02 to 0.5 px, 0 to 0.5 mm, 0 to 0.05 deg, intrinsics given or not")
    for setup, views in product(SETUPS, VIEWS):
        rng = np.random.default_rng([1, SETUPS.index(setup), views])
        table = rms(drawn_cell(rng, views, setup) for _ in range(options.cells))
        _print_methods(f"{setup}, {views} views", table)
    few = options.cells // 4
    if not few:
        return
    print(f"\nSingle mixes of noise, {few} cells each, intrinsics given: ours / the best; the bound / the best")
    for (name, noise), setup, views in product(MIXES, SETUPS, VIEWS):
        rng = np.random.default_rng([2, SETUPS.index(setup), views])
        table = rms((random_cell(rng, views, noise, setup=setup), noise) for _ in range(few))
        print(f"{name:>28} {setup:>12} {views:>3} views: {_verdict(table)}", flush=True)


def rms(cells: Iterator[tuple[Cell, CellNoise]]) -> Table:
    """Over the cells, for every method and for the bound. A method that gives no number has an infinite error."""
    methods = opencv_methods() | {KRONECKER: own("kronecker")}
    squares: dict[str, list[Array]] = {name: [] for name in (OURS, BOUND, *methods)}
    for cell, noise in cells:
        covariance = np.diagonal(bound_of(cell, noise).covariance)
        bound = np.array([covariance[:3].sum(), covariance[3:].sum()])
        squares[BOUND].append(np.concatenate([bound, np.ones(2)]))
        squares[OURS].append(_squares(cell, bound, estimated(cell.problem)[2].best.chain.mount_T_camera))
        prepared = prepare(cell.problem)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            for name, method in methods.items():
                squares[name].append(_squares(cell, bound, method(prepared)))
    return {name: np.sqrt(np.mean(found, axis=0)) * [np.degrees(1), 1, 1, 1] for name, found in squares.items()}


def _squares(cell: Cell, bound: Array, mount_T_camera: Array) -> Array:
    if not np.all(np.isfinite(mount_T_camera)):
        return np.full(4, np.inf)
    error = error_of(cell, mount_T_camera)
    both = np.array([error[:3] @ error[:3], error[3:] @ error[3:]])
    return np.concatenate([both, both / bound])


def _print_methods(heading: str, table: Table) -> None:
    print(f"{heading}: {_verdict(table)}")
    for name, (rotation, translation, *in_bounds) in table.items():
        print(
            f"{name:>22} {rotation:8.4f} deg {translation:8.3f} mm {in_bounds[0]:9.2f} {in_bounds[1]:6.2f}", flush=True
        )


def _verdict(table: Table) -> str:
    rivals = [name for name in table if name not in (OURS, BOUND, KRONECKER)]
    best = np.min([table[name] for name in rivals], axis=0)
    ours, bound = table[OURS] / best, table[BOUND] / best
    words = []
    for row, (what, bar) in enumerate(zip(("deg", "mm"), BARS, strict=True)):
        met = "met" if ours[row] <= bar else "NOT met" if bound[row] <= bar else "NOT met, nor could it be"
        words.append(f"{what} {ours[row]:.2f} (bound {bound[row]:.2f}; bar {bar}: {met})")
    return f"{', '.join(words)}; in bounds {ours[2]:.2f}, {ours[3]:.2f}"


if __name__ == "__main__":
    main()
