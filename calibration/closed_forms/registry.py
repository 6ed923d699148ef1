"""Closed forms by name."""

from collections.abc import Callable

from calibration.closed_forms.daniilidis import daniilidis
from calibration.closed_forms.horaud import horaud
from calibration.closed_forms.kronecker import kronecker
from calibration.closed_forms.park import park
from calibration.closed_forms.shah import shah
from calibration.closed_forms.three_pose import three_pose
from calibration.closed_forms.tsai import tsai
from calibration.transforms import Array

ClosedForm = Callable[[Array, Array], Array]

CLOSED_FORMS: dict[str, ClosedForm] = {
    "three-pose": three_pose,
    "tsai": tsai,
    "park": park,
    "horaud": horaud,
    "daniilidis": daniilidis,
    "shah": shah,
    "kronecker": kronecker,
}
