"""Arms whose errors have other forms than `arm_errors.py`: what is measured on them is a statement about arms.

`sagging`: geometry as delivered; one-sided sag that grows with the third power of the moment, and a forearm that bends
by 0.1 to 0.5 mm. `stiffness`: axes 2 and 3 turn by the moments of weight over their stiffness, of which the controller
compensates a share; stiffness of the size found for a KUKA KR 240 by C. Dumas, S. Caro, S. Garnier & B. Furet, "Joint
stiffness identification of six-revolute industrial serial robots", Robotics and Computer-Integrated Manufacturing 27,
2011 (their table was not at hand: the figures below are not checked against it), and by the third power of the reach.
`wavy`: second to fourth harmonics of the gears, and errors of links that three causes have in common.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from calibration.kinematics.arm import Arm
from calibration.kinematics.arm_errors import AXES, GRAVITY_M_S2, ArmErrorModel, Postures
from calibration.transforms import Array
from mock_robot.arm.built_arm import BuiltArm, build_arm

FAMILIES = ("sagging", "stiffness", "wavy")

STIFFNESS_N_M_RAD = np.array([6.6e6, 3.9e6])
STIFFNESS_REACH_M, LINK_KG = 2.7, np.array([170.0, 210.0])
"""Of axes 2 and 3 of an arm of that reach; the masses of lower arm and forearm are assumed."""

Turns = Callable[[Postures], Array]


@dataclass(frozen=True, eq=False)
class OtherArm(BuiltArm):
    """A built arm whose axes also turn by `turns` (n, 6) rad, and whose flange is lower by `drop_mm` (n,)."""

    turns: Turns
    drop_mm: Turns

    def base_T_flange(self, postures: Postures) -> Array:
        """Where the flange truly is (n, 4, 4)."""
        turned = replace(postures, joints_rad=postures.joints_rad + self.turns(postures))
        flange = self.model.forward(self.errors, turned).copy()
        flange[:, 2, 3] -= self.drop_mm(postures)
        return flange


def build_other_arm(arm: Arm, family: str, seed: int) -> OtherArm:
    """An arm of one of FAMILIES; the same seed gives the same arm."""
    rng = np.random.default_rng([seed, 41, FAMILIES.index(family)])
    base = build_arm(arm, "standard", seed)
    model, errors = base.model, base.errors.copy()
    errors[model.indices("sag", "warmth")] = 0.0
    if family == "sagging":
        turns, bent_mm = _cubic_sag(model, rng), rng.uniform(0.1, 0.5)
        return OtherArm(model, errors, turns, lambda at: bent_mm * _moments(model, at)[:, 1] ** 2)
    if family == "stiffness":
        return OtherArm(model, errors, _measured_sag(model, rng), lambda at: np.zeros(len(at)))
    links = model.indices("links")
    common = rng.standard_normal(3) @ rng.standard_normal((3, len(links))) / np.sqrt(3)
    errors[links] = model.sigmas[links] * common
    waves = 4e-5 * rng.standard_normal((2, 3, AXES))

    def turn(at: Postures) -> Array:
        angles = np.arange(2, 5)[:, None, None] * at.joints_rad
        turned: Array = np.sum(waves[0][:, None] * np.sin(angles) + waves[1][:, None] * np.cos(angles), axis=0)
        return turned

    return OtherArm(model, errors, turn, lambda at: np.zeros(len(at)))


def _moments(model: ArmErrorModel, at: Postures) -> Array:
    """Moments (n, 2) of lower arm and forearm about axes 2 and 3 over those of the stretched arm."""
    by_name = model.moments(at)
    return np.column_stack([by_name["2_by_lower_arm"][1], by_name["3_by_forearm"][1]])


def _cubic_sag(model: ArmErrorModel, rng: np.random.Generator) -> Turns:
    size = np.abs(rng.normal(2e-4, 1e-4, 2))

    def turn(at: Postures) -> Array:
        lower, upper = _moments(model, at).T
        both = (lower + upper) / 2
        turned = np.zeros((len(at), AXES))
        turned[:, 1], turned[:, 2] = size[0] * (both + both**3), size[1] * (upper + upper**3) / 2
        return turned

    return turn


def _measured_sag(model: ArmErrorModel, rng: np.random.Generator) -> Turns:
    """Weights over the stiffness of each axis, of which 30 to 70 % is compensated by the controller."""
    share = (model.arm.reach_mm / 1000 / STIFFNESS_REACH_M) ** 3
    stiffness = share * STIFFNESS_N_M_RAD * rng.uniform(0.7, 1.3, 2)
    lower_n, upper_n = share * LINK_KG * GRAVITY_M_S2
    lower_m = model.arm.lower_arm_mm / 1000
    upper_m = (model.arm.reach_mm - model.arm.shoulder_forward_mm) / 1000 - lower_m
    left = rng.uniform(0.3, 0.7)

    def turn(at: Postures) -> Array:
        lower, upper = _moments(model, at).T
        of_upper = 0.5 * upper_n * upper_m * upper
        turned = np.zeros((len(at), AXES))
        turned[:, 1] = left * ((0.5 * lower_n + upper_n) * lower_m * lower + of_upper) / stiffness[0]
        turned[:, 2] = left * of_upper / stiffness[1]
        return turned

    return turn
