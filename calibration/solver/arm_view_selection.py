"""Which views the arm with its errors explains.

Errors of the arm make views disagree, so that the choice made for the arm as drawn leaves out views that say most about
them. Starting from that choice views that fit are readmitted and the one that fits worst is dropped, as in
`view_outliers`, with the arm's errors among the unknowns.
"""

import numpy as np
from numpy.typing import NDArray

from calibration.likelihood.mixed_model import MixedModel, Variances, per_view_equations, solve
from calibration.likelihood.shared_columns import take_views
from calibration.likelihood.variance_components import estimate_variances
from calibration.linear_algebra import covariance_of, squared_distances
from calibration.solver.view_outliers import MAX_ROUNDS, min_remaining, outlier_limit
from calibration.transforms import Array


def select_views_with_arm(model: MixedModel, variances: Variances, used: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The views (n,) of `model` that agree, beginning with the `used` ones and their noise levels."""
    seen_before: set[bytes] = set()
    for _ in range(MAX_ROUNDS):
        seen_before.add(used.tobytes())
        variances = estimate_variances(take_views(model, used), variances)
        changed = _update(model, variances, used)
        if changed.tobytes() in seen_before:
            break
        used = changed
    return used


def _update(model: MixedModel, variances: Variances, used: NDArray[np.bool_]) -> NDArray[np.bool_]:
    changed, distances = used.copy(), _squared_distances(model, variances, used) / 6
    limit = outlier_limit(int(np.count_nonzero(used)), len(used))
    back = ~used & (distances < limit)
    if np.any(back):
        return changed | back
    if np.count_nonzero(used) > min_remaining(len(used)):
        worst = int(np.argmax(np.where(used, distances, -np.inf)))
        changed[worst] = not distances[worst] > limit
    return changed


def _squared_distances(model: MixedModel, variances: Variances, used: NDArray[np.bool_]) -> Array:
    """Squared Mahalanobis distance (n,) of each view's own pose from its prediction by the other used views; 6 dof."""
    p = model.unknowns
    kept = take_views(model, used)
    step = solve(kept, variances)
    information, gradient = per_view_equations(kept, variances, step)
    b, covariance = np.tile(step.b, (len(used), 1)), np.tile(step.covariance, (len(used), 1, 1))
    covariance[used] = covariance_of(step.information - information)
    b[used] = -(covariance[used] @ (step.gradient - gradient)[..., None])[..., 0]
    own = covariance_of(model.UU)  # of the robot's correction by which a view's own pose is reproduced, per px²
    by_shared = own @ model.UAy[:, :, :p]
    off = (by_shared @ b[..., None])[..., 0] + (own @ model.UAy[:, :, p, None])[..., 0]
    spread = variances.pixel * own + np.diag(variances.deviations() ** 2)
    return squared_distances(off, spread + by_shared @ covariance @ np.swapaxes(by_shared, 1, 2))
