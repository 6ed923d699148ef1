"""The linearised model of views of a target at several places: joined, restricted, and with known lengths."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calibration.likelihood.mixed_model import MixedModel
from calibration.transforms import Array


def join_places(models: Sequence[MixedModel]) -> MixedModel:
    """One model of the views of several places of the target: six unknowns for each place, after those of X.

    The models are without a trend and have the same unknowns.
    """
    first, more = models[0], 6 * (len(models) - 1)
    if not more:
        return first
    q = first.unknowns + 1
    wide = [np.r_[0:6, 6 * place + 6 : 6 * place + 12, 12 + more : q + more] for place in range(len(models))]
    zeros = np.zeros(more)
    return replace(
        first,
        by_robot=np.concatenate(
            [_spread(one.by_robot, np.r_[0:6, 6 + own], q + more + 6) for one, own in zip(models, wide, strict=True)]
        ),
        squares=np.concatenate(
            [
                np.swapaxes(_spread(np.swapaxes(_spread(one.squares, own, q + more), 1, 2), own, q + more), 1, 2)
                for one, own in zip(models, wide, strict=True)
            ]
        ),
        count=np.concatenate([one.count for one in models]),
        prior_information=np.insert(first.prior_information, 12, zeros),
        prior_offset=np.insert(first.prior_offset, 12, zeros),
        mixture_at=first.mixture_at + more,
        basis=np.concatenate([one.basis for one in models]),
    )


def with_distances(model: MixedModel, rows: Array, misses: Array, sigmas: Array) -> MixedModel:
    """The model with observed lengths: derivatives (d, p) by the unknowns, present lengths less those known (d,).

    `sigmas` (d,): one standard deviation of each. For a model without a trend.
    """
    weighed = np.column_stack([rows, misses]) / sigmas[:, None]
    return replace(model, direct=weighed.T @ weighed)


def _spread(columns: Array, own: NDArray[np.intp], width: int) -> Array:
    """Columns (..., q) at places `own` (q,) of (..., width), zeros elsewhere."""
    wide = np.zeros((*columns.shape[:-1], width))
    wide[..., own] = columns
    return wide


def fix_unknowns(model: MixedModel, fixed: NDArray[np.intp], step: Array) -> MixedModel:
    """The model in which the unknowns at places `fixed` (f,) take the `step` (f,), and the others remain unknown."""
    kept = np.setdiff1d(np.arange(model.unknowns), fixed)

    def substitute(columns: Array) -> Array:
        taken: Array = columns[..., np.append(kept, model.unknowns)]
        taken[..., -1] += columns[..., fixed] @ step
        return taken

    def substitute_both(squares: Array) -> Array:
        return np.swapaxes(substitute(np.swapaxes(substitute(squares), -1, -2)), -1, -2)

    return replace(
        model,
        by_robot=np.concatenate([model.UU, substitute(model.UAy)], axis=2),
        squares=substitute_both(model.squares),
        prior_information=model.prior_information[kept],
        prior_offset=model.prior_offset[kept],
        direct=None if model.direct is None else substitute_both(model.direct),
    )


def take_views(model: MixedModel, chosen: NDArray[np.bool_]) -> MixedModel:
    """The model of the chosen views only."""
    parts = {name: getattr(model, name)[chosen] for name in ("by_robot", "squares", "count", "basis")}
    return replace(model, **parts)
