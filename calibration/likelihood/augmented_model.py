"""The session linearised once at its estimate, with everything that might yet be asked for among the unknowns."""

from dataclasses import dataclass

import numpy as np

from calibration.likelihood.estimate import Estimate, Free, linearise, measured
from calibration.likelihood.mixed_model import MixedModel
from calibration.likelihood.systematic_errors import CENTRE
from calibration.observations.observations import Observations
from calibration.observations.reprojection import INTRINSICS


@dataclass(frozen=True, eq=False)
class Widened:
    """`model` has the unknowns of the estimate `best`, the target's scale, and the centre of a given camera."""

    best: Estimate
    free: Free
    model: MixedModel

    def freeing(self, free: Free) -> MixedModel:
        """The model in which only `free` (10,) are unknown, beside X and the target's pose."""
        kept = free[self.free]
        return self.model if np.all(kept) else self.model.only(np.concatenate([np.ones(12, bool), kept]))


def widened(seen: Observations, best: Estimate) -> Widened:
    """Of the views that the estimate is from."""
    free = best.free.copy()
    free[INTRINSICS] = True
    if not np.any(best.free[:INTRINSICS]):
        free[list(CENTRE)] = True
    return Widened(best, free, linearise(measured(seen, free), best.chain, best.camera, best.scale))
