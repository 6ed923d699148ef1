"""Estimation of the three noise levels from the residuals, by restricted maximum likelihood.

With P = V^-1 - V^-1 A (A' V^-1 A)^-1 A' V^-1 and V = sum_g s_g² V_g, the estimate satisfies y' P V_g P y = tr(P V_g)
for every group g. The pixels' level moves by s² <- s² (y' P P y) / tr(P), Helmert's and Foerstner's v'v over its
redundancy; the robot's two by Fisher scoring (iterated MINQUE: sum_h tr(P V_g P V_h) s_h² = y' P V_g P y), whose
solution may be zero: a robot can be exact.
Sources: W. Foerstner & B. Wrobel, Photogrammetric Computer Vision, 2016, 4.2.4; C. R. Rao, J. Multivar. Anal. 1, 1971.
"""

from dataclasses import dataclass

import numpy as np

from calibration.likelihood.mixed_model import MixedModel, Step, Variances, solve, sum_products
from calibration.linear_algebra import unit_diagonal
from calibration.transforms import Array

MIN_PIXEL_VARIANCE = 1e-6
"""px²: a thousandth of a pixel, better than any image; below it the robot's part is lost in rounding."""

MAX_CORRELATION = 1 - 1e-9
"""Largest correlation of the two robot variances; beyond it they are not separable, and only one is estimated."""

GROUPS = (slice(0, 3), slice(3, 6))


@dataclass(frozen=True, eq=False)
class Redundancy:
    """Quadratic forms y'PV_gPy (2,) of the robot's groups, their expected traces (2,) and Fisher matrix (2, 2).

    `trend` (2,): the variances of the trend's coefficients, their squares over their redundancy.
    """

    quadratic: Array
    trace: Array
    fisher: Array
    pixel_quadratic: float
    pixel_trace: float
    trend: Array


def estimate_variances(model: MixedModel, variances: Variances, iterations: int = 30) -> Variances:
    """The noise levels of restricted maximum likelihood, starting from the given ones."""
    for _ in range(iterations):
        old = np.sqrt(list(vars(variances).values()))
        variances = _update(redundancy(model, variances), variances)
        new = np.sqrt(list(vars(variances).values()))
        if np.all(np.abs(new - old) <= 1e-3 * np.maximum(new, 1e-9)):
            break
    return variances


def redundancy(model: MixedModel, variances: Variances) -> Redundancy:
    """The terms of the update at the given levels."""
    step = solve(model, variances)
    pixel, K, S_inv, p = variances.pixel, step.K, step.covariance, model.unknowns
    b1 = np.append(step.b, 1.0)
    UUK = model.UU @ K
    W = (model.UU - UUK @ model.UU) / pixel  # U' V^-1 U
    WAy = (model.UAy - model.UU @ step.KUAy) / pixel  # U' V^-1 [A, y]
    WA, u = WAy[:, :, :p], WAy @ b1  # u = U' P y
    SA = [sum_products(WA[:, g], WA[:, g]) for g in GROUPS]
    quadratic = np.array([np.sum(u[:, g] ** 2) for g in GROUPS])
    trace = np.array([np.sum(np.diagonal(W[:, g, g], axis1=1, axis2=2)) for g in GROUPS])
    trace -= [np.sum(S_inv * part) for part in SA]
    # With e = y + A b: y'PPy = e' V^-1 V^-1 e, and U'V^-1 e = u.
    KUe = step.KUAy @ b1
    ee = b1 @ model.total @ b1
    pixel_quadratic = (ee - np.sum(KUe * (model.UAy @ b1 + pixel * u))) / pixel**2
    effective = np.sum(UUK * np.eye(6))
    # A' V^-1 V^-1 A
    AVVA = step.information - model.beside_views(variances)[:p, :p] - sum_products(step.KUAy[:, :, :p], WA)
    pixel_trace = (model.count.sum() - effective - np.sum(S_inv * AVVA)) / pixel
    return Redundancy(
        quadratic,
        trace,
        _fisher(W, WA, [S_inv @ part for part in SA], S_inv),
        float(pixel_quadratic),
        float(pixel_trace),
        _trend(model, variances, step),
    )


def _trend(model: MixedModel, variances: Variances, step: Step) -> Array:
    m = model.trend_terms
    if not m:
        return np.zeros(2)
    coefficients, posterior_variances = (
        step.b[-6 * m :].reshape(m, 6),
        np.diagonal(step.covariance)[-6 * m :].reshape(m, 6),
    )
    spent = (posterior_variances / variances.trend_variances()).sum(axis=0).reshape(2, 3).sum(axis=1)
    squares = (coefficients**2).sum(axis=0).reshape(2, 3).sum(axis=1)
    levels: Array = squares / np.maximum(3 * m - spent, 1e-3)
    return levels


def _fisher(W: Array, WA: Array, SS: list[Array], S_inv: Array) -> Array:
    """tr(P V_g P V_h) (2, 2); `SS`: S^-1 A' V^-1 V_g V^-1 A of each group."""
    result = np.empty((2, 2))
    for g, h in ((0, 0), (0, 1), (1, 1)):
        rows, columns = GROUPS[g], GROUPS[h]
        block = W[:, rows, columns]
        mixed = sum_products(WA[:, rows], block @ WA[:, columns])
        result[g, h] = np.sum(block**2) - 2 * np.sum(S_inv * mixed) + np.sum(SS[g] * SS[h].T)
    result[1, 0] = result[0, 1]
    return result


def _update(found: Redundancy, variances: Variances) -> Variances:
    pixel = variances.pixel * found.pixel_quadratic / max(found.pixel_trace, 1e-300) if found.pixel_trace > 0 else 0.0
    rotation, translation = nonnegative_variances(found.fisher, found.quadratic).tolist()
    return Variances(max(pixel, MIN_PIXEL_VARIANCE), rotation, translation, *found.trend.tolist())


def nonnegative_variances(fisher: Array, quadratic: Array) -> Array:
    """v (..., 2) >= 0 with fisher (..., 2, 2) @ v = quadratic (..., 2), one step of Fisher scoring.

    Where one of the two would be negative it is zero, and the other, with the larger score, is solved alone.
    """
    scaled, scale = unit_diagonal(fisher)
    score = scale * quadratic
    correlation = np.clip(scaled[..., :1, 1], -MAX_CORRELATION, MAX_CORRELATION)
    both = scale * (score - correlation * score[..., ::-1]) / (1 - correlation**2)
    larger = score == score.max(axis=-1, keepdims=True)
    alone = np.where(larger, scale * np.maximum(score, 0.0), 0.0)
    return np.where(np.all(both >= 0, axis=-1, keepdims=True), both, alone)
