"""Inverses of information and covariance matrices whose unknowns have different units.

Radians and millimetres differ by orders of magnitude, so a matrix of both looks singular where nothing is undetermined.
Every function here first scales its matrix to a unit diagonal (of an information matrix: to the accuracy that each
unknown would have if all others were known). An eigenvalue of the scaled matrix then says how well a direction is
determined, whatever the units: 1 for unknowns that do not disturb each other, 0 for what is not determined at all.

The functions differ in what they answer where a direction is not determined:

    covariance_of            a very large but finite variance
    covariance_or_inf        infinity, for all unknowns
    scaled_pseudo_inverse    zero: a step leaves that direction alone
    scaled_inverse, scaled_solve, scaled_inverse_and_log_determinant
                             as if a ridge had been added; several times quicker, for large stacks
    inverse_or_pseudo_inverse  no scaling, quickest, for matrices known to be regular up to accidents

All matrices are symmetric; all functions work on stacks (..., k, k) of them.
"""

import numpy as np

from calibration.transforms import Array

MIN_DIAGONAL = 1e-30
"""A diagonal element below it counts as this large: an unknown without any information must not divide by zero."""

MIN_EIGENVALUE = 1e-14
"""Of a scaled matrix. The eigenvalues of a sum of squares in double precision are exact to about this much."""

MIN_DETERMINED = 1e-13
"""A smallest eigenvalue of a scaled matrix up to this is zero within rounding: something is not determined."""

MIN_REGULAR_PIVOT = 1e-9
"""A smallest pivot of a scaled matrix above it is far from MIN_DETERMINED: the eigenvalues need not be computed."""

RIDGE = 1e-12
"""Added to the diagonal of a scaled matrix. It is a hundred times above rounding, so that what is undetermined stays
finite, and a million times below the smallest eigenvalues of sessions that determine X."""


def unit_diagonal(matrices: Array) -> tuple[Array, Array]:
    """(scaled, scale): scaled = S M S (..., k, k) has a unit diagonal; S = diag(scale), scale (..., k)."""
    scale = 1 / np.sqrt(np.maximum(np.diagonal(matrices, axis1=-2, axis2=-1), MIN_DIAGONAL))
    return matrices * scale[..., :, None] * scale[..., None, :], scale


def covariance_of(information: Array) -> Array:
    """Inverses (..., k, k), positive definite; what is not determined gets 1 / MIN_EIGENVALUE of its scaled variance.

    Raises LinAlgError for numbers that are not finite.
    """
    scaled, scale = unit_diagonal(information)
    values, vectors = np.linalg.eigh(scaled)
    vectors = scale[..., :, None] * vectors
    covariance: Array = (vectors / np.maximum(values, MIN_EIGENVALUE)[..., None, :]) @ np.swapaxes(vectors, -1, -2)
    return covariance


def covariance_or_inf(information: Array, size: int) -> Array:
    """Covariances (..., size, size) of the first `size` unknowns; infinite diagonals where any unknown is undetermined.

    Elements beside an infinite diagonal are zero. Raises LinAlgError for numbers that are not finite.
    """
    scaled, scale = unit_diagonal(information)
    regular = _leading_inverse(scaled, size)
    if regular is not None:
        return scale[..., :size, None] * regular * scale[..., None, :size]
    values, vectors = np.linalg.eigh(scaled)
    determined = values[..., 0] > MIN_DETERMINED
    values = np.where(determined[..., None], values, 1.0)
    rows = vectors[..., :size, :] * scale[..., :size, None]
    covariance: Array = (rows / values[..., None, :]) @ np.swapaxes(rows, -1, -2)
    return np.where(determined[..., None, None], covariance, np.diag(np.full(size, np.inf)))


def _leading_inverse(scaled: Array, size: int) -> Array | None:
    """The first (size, size) of the inverses, by Cholesky; None unless all matrices are far from singular.

    With the order of the unknowns reversed, the last block of the factor is that of the Schur complement.
    """
    try:
        factor = np.linalg.cholesky(scaled[..., ::-1, ::-1])
    except np.linalg.LinAlgError:
        return None
    if not np.all(np.diagonal(factor, axis1=-2, axis2=-1) ** 2 > MIN_REGULAR_PIVOT):
        return None
    root = np.linalg.inv(factor[..., -size:, -size:])[..., ::-1, ::-1]
    inverse: Array = np.swapaxes(root, -1, -2) @ root
    return inverse


def scaled_pseudo_inverse(matrices: Array, min_eigenvalue: float) -> Array:
    """Inverses (..., k, k) over the directions whose scaled eigenvalue is above `min_eigenvalue`; zero in the others.

    Raises LinAlgError for numbers that are not finite.
    """
    scaled, scale = unit_diagonal(matrices)
    values, vectors = np.linalg.eigh(scaled)
    kept = values > min_eigenvalue
    vectors = scale[..., :, None] * vectors
    inverse: Array = (vectors * (kept / np.where(kept, values, 1.0))[..., None, :]) @ np.swapaxes(vectors, -1, -2)
    return inverse


def scaled_inverse(matrices: Array, ridge: float = RIDGE) -> Array:
    """Inverses (..., k, k) of M + ridge diag(M); up to 1 / ridge in scaled units where M is singular."""
    scaled, scale = _with_ridge(matrices, ridge)
    return scale[..., :, None] * inverse_or_pseudo_inverse(scaled) * scale[..., None, :]


def scaled_solve(matrices: Array, right_hand: Array, ridge: float = RIDGE) -> Array:
    """x (..., k, m) with (M + ridge diag(M)) x = `right_hand` (..., k, m)."""
    scaled, scale = _with_ridge(matrices, ridge)
    right_hand = scale[..., :, None] * right_hand
    try:
        solved = np.linalg.solve(scaled, right_hand)
    except np.linalg.LinAlgError:
        solved = np.linalg.pinv(scaled, hermitian=True) @ right_hand
    answer: Array = scale[..., :, None] * solved
    return answer


def scaled_inverse_and_log_determinant(matrices: Array, ridge: float = RIDGE) -> tuple[Array, Array]:
    """Inverses (..., k, k) and log determinants (...) of M + ridge diag(M), by Cholesky; the inverses are positive.

    Where that is not positive definite the determinant is infinite, so that a likelihood with -log det M / 2 is zero,
    and the inverse as of `covariance_of`. Raises LinAlgError for numbers that are not finite.
    """
    scaled, scale = _with_ridge(matrices, ridge)
    try:
        factor = np.linalg.cholesky(scaled)
    except np.linalg.LinAlgError:
        log_determinant = np.where(np.linalg.eigvalsh(scaled)[..., 0] > 0, np.linalg.slogdet(scaled)[1], np.inf)
        return covariance_of(matrices), log_determinant - 2 * np.log(scale).sum(axis=-1)
    root = scale[..., :, None] * np.swapaxes(np.linalg.inv(factor), -1, -2)
    diagonal = np.diagonal(factor, axis1=-2, axis2=-1)
    return root @ np.swapaxes(root, -1, -2), 2 * (np.log(diagonal) - np.log(scale)).sum(axis=-1)


def squared_distances(off: Array, covariance: Array) -> Array:
    """Squared Mahalanobis distances off' C^-1 off (...) of vectors (..., k) with covariances C (..., k, k)."""
    squared: Array = np.sum(off * scaled_solve(covariance, off[..., None])[..., 0], axis=-1)
    return squared


def mixture_moments(weights: Array, means: Array, covariances: Array) -> tuple[Array, Array]:
    """Mean (p,) and covariance (p, p) of a mixture of k densities by their weights, means (k, p) and covariances."""
    mean = weights @ means
    off = means - mean
    return mean, np.tensordot(weights, covariances, 1) + (weights[:, None] * off).T @ off


def inverse_or_pseudo_inverse(matrices: Array) -> Array:
    """Plain inverses (..., k, k); pseudo-inverses of the whole stack when one of it is exactly singular."""
    try:
        return np.asarray(np.linalg.inv(matrices), np.float64)
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.pinv(matrices, hermitian=True), np.float64)


def _with_ridge(matrices: Array, ridge: float) -> tuple[Array, Array]:
    scaled, scale = unit_diagonal(matrices)
    return scaled + ridge * np.eye(matrices.shape[-1]), scale
