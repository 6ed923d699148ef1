"""Between two verifications one thing changed: which of them it was is named, with its chance."""

import numpy as np
import pytest

from calibration.kinematics.abb_arms import find_arm
from tests.simulated.changed_cells import Change, changes_of
from tests.support.cases import seeds

ARM = find_arm("IRB 2600-20/1.65")

TABLE = [
    (Change(), "nothing", None),
    (Change(camera_mm=0.4), "camera-moved", None),
    (Change(target_mm=0.4), "target-moved", None),
    *((Change(axis=axis, zero_rad=float(np.radians(0.02))), "axis-zero", axis) for axis in range(1, 7)),
]


@pytest.mark.parametrize(("change", "cause", "axis"), TABLE, ids=str)
@pytest.mark.parametrize("seed", seeds(3))
def test_what_changed_is_the_likeliest(change: Change, cause: str, axis: int | None, seed: int) -> None:
    found = changes_of(ARM, change, seed)
    assert (found[0].cause, found[0].axis) == (cause, axis), found[:3]
    assert found[0].chance > 0.5
    assert sum(one.chance for one in found) == pytest.approx(1.0, abs=1e-5)
    if axis is not None:
        assert found[0].turned_deg == pytest.approx(0.02, rel=0.25)


def test_it_is_the_likeliest_in_an_eye_to_hand_cell_too() -> None:
    for change, cause, axis in TABLE:
        found = changes_of(ARM, change, 1, eye_to_hand=True)
        assert (found[0].cause, found[0].axis) == (cause, axis), found[:3]


def test_verifications_at_other_stations_are_not_compared() -> None:
    assert changes_of(ARM, Change(axis=2, zero_rad=0.001), 0, same_stations=False) == []
