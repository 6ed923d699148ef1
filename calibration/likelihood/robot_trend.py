"""The part of a robot's errors that follows its pose: geometric errors differ little between neighbouring poses."""

import numpy as np

from calibration.transforms import Array, vector_from_rotation


def trend_basis(base_T_flange: Array) -> Array:
    """Regressors (n, 6) of the trend: position and orientation about their mean, in units of their spread."""
    places = base_T_flange[:, :3, 3] - base_T_flange[:, :3, 3].mean(axis=0)
    turns = vector_from_rotation(base_T_flange[0, :3, :3].T @ base_T_flange[:, :3, :3])
    turns = turns - turns.mean(axis=0)
    parts = [part / max(float(np.sqrt(np.mean(np.sum(part**2, axis=1)))), 1e-12) for part in (places, turns)]
    return np.concatenate(parts, axis=1)
