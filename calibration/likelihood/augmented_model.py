"""Linear model at the estimate, augmented by unknowns (target scale, principal point) that later tests may free."""

from dataclasses import dataclass

import numpy as np

from calibration.likelihood.estimate import Estimate, FreeMask, exact_pixels, linearise
from calibration.likelihood.mixed_model import MixedModel
from calibration.likelihood.systematic_errors import CENTRE_INDICES
from calibration.observations.observations import Observations
from calibration.observations.reprojection import INTRINSICS


@dataclass(frozen=True, eq=False)
class AugmentedModel:
    """`model` with the unknowns of the estimate `best`, the target's scale, and the centre of a given camera."""

    best: Estimate
    free: FreeMask
    model: MixedModel

    def restrict_to(self, free: FreeMask) -> MixedModel:
        """The model in which only `free` (10,) are unknown besides X and the target's pose."""
        kept = free[self.free]
        return self.model if np.all(kept) else self.model.select(np.concatenate([np.ones(12, bool), kept]))


def augment_model(seen: Observations, best: Estimate) -> AugmentedModel:
    """The augmented model of an estimate; `seen`: the views it is from."""
    free = best.free.copy()
    free[INTRINSICS] = True
    if not np.any(best.free[:INTRINSICS]):
        free[list(CENTRE_INDICES)] = True
    return AugmentedModel(best, free, linearise(exact_pixels(seen, free), best.chain, best.camera, best.scale))
