"""The built arm: how its geometry, gears, sag, play and warmth differ from the drawing, and where its flange then is.

    base_T_flange = product over axes 1 to 6 of  Rot(axis, q + dq) · L · E

`q` is the angle that the controller reports, `dq` its error, L the drawing's link up to the next axis, and E a small
error [rotation rad, translation mm] at the next axis. Of the 42 errors of links and zeros 18 can be seen by any
measurement from the flange, since base and flange have free places of their own (L. J. Everett & A. H. Suryohadiprojo,
"A study of kinematic models for forward calibration of manipulators", ICRA 1988). Here the others are zero by
convention: the base is where axis 1, its zero and its height put it, the flange where axis 6, its zero and its length
do; a shift along the parallel axes 2 and 3 counts as one of axis 2, a shift of axis 3 across the lower arm as zeros of
axes 2 and 3.

Standard deviations are those of arms as delivered; docs/arm-errors.md has their sources.
"""

from dataclasses import dataclass
from itertools import product
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from calibration.kinematics.arm import Arm
from calibration.kinematics.load import NO_LOAD, Load
from calibration.transforms import Array, adjoint, inverse, map_points, rotation_from_vector, transform

Group = Literal["zeros", "links", "gears", "sag", "rest", "play", "warmth"]

AXES = 6
GRAVITY_M_S2 = 9.81

_DIRECTIONS = np.eye(3)[[2, 1, 1, 0, 1, 0]]
"""Axes 1 to 6 (6, 3) with all joints zero."""

_LINK_ERRORS = {1: "rx tx ty", 2: "rx rz tz", 3: "rz tx tz", 4: "rz ty tz", 5: "rz tz"}
"""What can be distinguished of the error of each link: up to axis 2, 3, 4, 5 and 6."""

_WAVES = ("sine", "cosine")
_COMPONENTS = ("rx", "ry", "rz", "tx", "ty", "tz")
_OWN_SAGS = {"2_by_lower_arm": 1.3e-4, "2_by_forearm": 0.6e-4, "3_by_forearm": 0.9e-4}
"""Mean of the sag by own weight that the controller leaves, rad at the stretched arm for each metre of its reach."""

_CUBIC_SAGS = {"2_by_both_cubed": 0.6e-4, "3_by_forearm_cubed": 0.3e-4}
"""One standard deviation of the part by the third power of the moment: gears are softer or stiffer under load."""

COMMON_SAG_SIGMA, OWN_SAG_SIGMA = 0.58, 0.4
"""Over the mean, of all sags and bends by own weight together, and of each: a controller leaves one share of all of
them, evenly from none to the whole, and weights and stiffnesses differ."""

_LOAD_SAGS = ("2_by_load", "3_by_load", "5_by_load")

_BENDS = {2: ("lower_arm", [1.0, 0.0, 0.0]), 3: ("forearm", [0.0, 0.0, -1.0])}
"""By whose weight a link bends, and whither with all joints zero."""

ZERO_SIGMA_RAD = float(np.radians(0.02))
TWIST_SIGMA_RAD = float(np.radians(0.015))
LENGTH_SIGMA_MM = 0.2
ECCENTRICITY_SIGMA_RAD = 6e-5
RATIO_SIGMA = 2e-5
REST_HARMONICS = (2, 3)
"""Of each axis's angle, and the first of them of the forearm's elevation, which weight follows, at axes 2 and 3. Their
amplitudes are as the first one's over the harmonic: what parameters lack is smooth."""
BEND_MM = 0.1
"""Mean, of a level link of an arm of 1 m reach by its own weight; it grows with the reach."""
COMPLIANCE_SIGMA = 2e-6
"""rad/(N m) of an axis of an arm of 1 m reach; it falls with the third power of the reach."""
PLAY_SIGMA_RAD = 4e-5
"""Half the play of an axis."""
EXPANSION_MEAN, EXPANSION_SIGMA = 1.7e-5, 0.4e-5
"""1/K: cast iron has 1.1e-5, aluminium 2.3e-5; every arm gets longer as it gets warmer."""

MAX_USUAL_SIGMAS = 6.0
"""A parameter beyond so many of its standard deviations is no arm's: another arm, axis order, sign or zero."""


@dataclass(frozen=True)
class ErrorParameter:
    """One error: `name` without spaces, its group, unit, the axis (1 to 6) it belongs to.

    sigma : its standard deviation among arms as delivered.
    mean : its mean among them.
    """

    name: str
    group: Group
    unit: str
    axis: int
    sigma: float
    mean: float = 0.0

    @property
    def largest(self) -> float:
        """What no arm is beyond, from the mean; own weight's sags are told apart poorly: one may be of any size."""
        if self.group == "sag" and not self.name.endswith("load"):
            return float("inf")
        # what the others lack gathers in the harmonics of the rest: they are judged as a gear's first one
        return MAX_USUAL_SIGMAS * (ECCENTRICITY_SIGMA_RAD if self.group == "rest" else self.sigma)


@dataclass(frozen=True, eq=False)
class Postures:
    """n standstills of the arm: joints (n, 6) as reported, and what else its errors depend on.

    sides : (n, 6) 1 where an axis came from below, -1 from above, 0 where that is not known.
    warmth_k : (n,) temperature of the arm above that at which it is described.
    """

    joints_rad: Array
    load: Load = NO_LOAD
    sides: Array | None = None
    warmth_k: Array | None = None

    def __len__(self) -> int:
        return len(self.joints_rad)

    def take(self, chosen: NDArray[np.intp] | NDArray[np.bool_]) -> "Postures":
        """Only the chosen ones."""
        parts = [None if part is None else part[chosen] for part in (self.sides, self.warmth_k)]
        return Postures(self.joints_rad[chosen], self.load, *parts)


class ArmErrorModel:
    """The errors of one listed arm as parameters (k,), with their prior, and the flange's pose by them."""

    def __init__(self, arm: Arm) -> None:
        self.arm = arm
        self.parameters = _parameters(arm)
        self.sigmas: Array = np.array([parameter.sigma for parameter in self.parameters])
        self.means: Array = np.array([parameter.mean for parameter in self.parameters])
        self._usual_sag = self.means * np.isin(np.arange(len(self.means)), self.indices("sag"))
        tool = arm.forward(np.zeros(AXES))[:3, :3]
        elbow = np.array([arm.forearm_mm, 0.0, arm.elbow_up_mm])
        shoulder = np.array([arm.shoulder_forward_mm, 0.0, arm.shoulder_height_mm])
        ahead, up = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
        self._links: Array = np.array(
            [shoulder, arm.lower_arm_mm * up, elbow, 0 * up, arm.wrist_offset_mm * up, arm.flange_mm * ahead]
        )
        self._tool = transform(tool, np.zeros(3))

    def __len__(self) -> int:
        return len(self.parameters)

    def indices(self, *groups: Group) -> NDArray[np.intp]:
        """Positions of the parameters of these groups."""
        return np.array([row for row, parameter in enumerate(self.parameters) if parameter.group in groups], np.intp)

    def index(self, name: str) -> int:
        """Position of a parameter. Raises ValueError for another name."""
        return [parameter.name for parameter in self.parameters].index(name)

    def forward(self, parameters: Array, postures: Postures) -> Array:
        """base_T_flange (n, 4, 4) of the built arm."""
        return self._frames(parameters, postures)[-1]

    def jacobian(self, parameters: Array, postures: Postures) -> Array:
        """Derivative (n, 6, k) of the pose by the parameters, as [rotation, translation] of base_T_flange @ exp(.).

        Exact up to the square of the parameters: to a thousandth for errors of a millimetre in a metre.
        """
        *frames, flange = self._frames(parameters, postures)
        regressors = self._regressors(postures)
        to_flange = adjoint(inverse(flange) @ np.array(frames))  # (12, n, 6, 6)
        result = np.zeros((len(postures), 6, len(self)))
        for axis, moved in enumerate(self._link_regressors(postures)):
            turned = to_flange[2 * axis, :, :, :3] @ _DIRECTIONS[axis]
            result += turned[:, :, None] * regressors[axis][:, None] + to_flange[2 * axis + 1] @ moved
        return result

    def _frames(self, parameters: Array, postures: Postures) -> list[Array]:
        """Frames (n, 4, 4) in the base behind each turn and each link, twelve of them, and the flange."""
        turns = postures.joints_rad + np.einsum("ank,k->na", self._regressors(postures), parameters)
        here, frames = np.broadcast_to(np.eye(4), (len(postures), 4, 4)), []
        for axis, error in enumerate(self._link_regressors(postures) @ parameters):
            turn = rotation_from_vector(turns[:, axis, None] * _DIRECTIONS[axis])
            here = here @ transform(turn, np.zeros((len(postures), 3)))
            frames.append(here)
            here = here @ transform(rotation_from_vector(error[:, :3]), self._links[axis] + error[:, 3:])
            frames.append(here)
        return [*frames, here @ self._tool]

    def _link_regressors(self, postures: Postures) -> Array:
        """Derivative (6, n, 6, k) of the error [rotation rad, translation mm] behind each link by the parameters."""
        found = np.zeros((AXES, len(postures), 6, len(self)))
        for row, parameter in enumerate(self.parameters):
            if parameter.name.startswith("link_"):
                _, behind, component = parameter.name.split("_")
                found[int(behind) - 1, :, _COMPONENTS.index(component), row] = 1.0
        moments = self.moments(postures)
        for bent, (own, along) in _BENDS.items():
            found[bent - 1, :, 3:, self.index(f"bend_{bent}")] = moments[f"{bent}_by_{own}"][1][:, None] * along
        found[..., self.index("sag_common")] = found @ self._usual_sag
        if postures.warmth_k is not None:
            found[:, :, 3:, self.index("expansion")] = self._links[:, None] * postures.warmth_k[:, None]
        return found

    def _regressors(self, postures: Postures) -> Array:
        """Derivative (6, n, k) of each axis's true angle by the parameters."""
        q = postures.joints_rad
        found = np.zeros((AXES, len(q), len(self)))
        of_axis, rise = {"zero": np.ones(q.shape), "ratio": q}, np.tile(q[:, 1:2] + q[:, 2:3], AXES)
        for label, turns in {"": q, **{str(times): times * q for times in REST_HARMONICS}, "up": 2 * rise}.items():
            of_axis |= {f"sine{label}": np.sin(turns), f"cosine{label}": np.cos(turns)}
        if postures.sides is not None:
            of_axis["play"] = -postures.sides
        for row, parameter in enumerate(self.parameters):
            if (kind := parameter.name.split("_")[0]) in of_axis:
                found[parameter.axis - 1, :, row] = of_axis[kind][:, parameter.axis - 1]
        for name, (axis, moment) in self.moments(postures).items():
            found[axis - 1, :, self.index(f"sag_{name}")] = moment
        found[..., self.index("sag_common")] = found @ self._usual_sag
        return found

    def moments(self, postures: Postures) -> dict[str, tuple[int, Array]]:
        """Axis and moment (n,) about it: of own weight over that of the stretched arm, of the load in N m."""
        arm, load = self.arm, postures.load
        shoulder, elbow, wrist, _ = np.moveaxis(arm.skeleton(postures.joints_rad), -2, 0)
        carried = map_points(arm.forward(postures.joints_rad), np.array([load.centre_mm]))[:, 0]
        q1, q2, q3, q4 = postures.joints_rad[:, :4].T
        across = rotation_from_vector(q1[:, None] * _DIRECTIONS[0]) @ _DIRECTIONS[1]
        wrist_axis = _DIRECTIONS[4]  # axis 5 in the base
        for angle, direction in zip((q4, q2 + q3, q1), _DIRECTIONS[[3, 1, 0]], strict=True):
            wrist_axis = (rotation_from_vector(angle[:, None] * direction) @ wrist_axis[..., None])[..., 0]
        newtons = load.mass_kg * GRAVITY_M_S2 * 1e-3
        forearm = arm.reach_mm - arm.shoulder_forward_mm - arm.lower_arm_mm
        of_lower_arm = _moment(across, elbow - shoulder) / arm.lower_arm_mm
        of_forearm = _moment(across, wrist - elbow) / forearm
        return {
            "2_by_lower_arm": (2, of_lower_arm),
            "2_by_forearm": (2, of_forearm),
            "3_by_forearm": (3, of_forearm),
            "2_by_both_cubed": (2, ((of_lower_arm + of_forearm) / 2) ** 3),
            "3_by_forearm_cubed": (3, of_forearm**3),
            "2_by_load": (2, newtons * _moment(across, carried - shoulder)),
            "3_by_load": (3, newtons * _moment(across, carried - elbow)),
            "5_by_load": (5, newtons * _moment(wrist_axis, carried - wrist)),
        }


def _moment(axis: Array, arm: Array) -> Array:
    """Component (n,) along `axis` of arm × down, for lever arms (n, 3): positive where a weight lowers the arm."""
    return np.asarray(np.sum(axis * np.cross(arm, [0.0, 0.0, -1.0]), axis=-1))


def _parameters(arm: Arm) -> tuple[ErrorParameter, ...]:
    reach_m = arm.reach_mm / 1000
    found = [ErrorParameter(f"zero_{axis}", "zeros", "rad", axis, ZERO_SIGMA_RAD) for axis in range(2, AXES)]
    for link, components in _LINK_ERRORS.items():
        for component in components.split():
            turn = component.startswith("r")
            sigma, unit = (TWIST_SIGMA_RAD, "rad") if turn else (LENGTH_SIGMA_MM, "mm")
            found.append(ErrorParameter(f"link_{link}_{component}", "links", unit, link + 1, sigma))
    for axis in range(1, AXES + 1):
        found.append(ErrorParameter(f"ratio_{axis}", "gears", "rad/rad", axis, RATIO_SIGMA))
        for wave in _WAVES:
            found.append(ErrorParameter(f"{wave}_{axis}", "gears", "rad", axis, ECCENTRICITY_SIGMA_RAD))
    for name, mean in _OWN_SAGS.items():
        usual = mean * reach_m
        found.append(ErrorParameter(f"sag_{name}", "sag", "rad", int(name[0]), OWN_SAG_SIGMA * usual, usual))
    for name in _LOAD_SAGS:
        found.append(ErrorParameter(f"sag_{name}", "sag", "rad/(N m)", int(name[0]), COMPLIANCE_SIGMA / reach_m**3))
    found += [ErrorParameter(f"play_{axis}", "play", "rad", axis, PLAY_SIGMA_RAD) for axis in range(1, AXES + 1)]
    found.append(ErrorParameter("expansion", "warmth", "1/K", 1, EXPANSION_SIGMA, EXPANSION_MEAN))
    for name, sigma in _CUBIC_SAGS.items():
        found.append(ErrorParameter(f"sag_{name}", "sag", "rad", int(name[0]), sigma * reach_m))
    for link in _BENDS:
        usual = BEND_MM * reach_m
        found.append(ErrorParameter(f"bend_{link}", "sag", "mm", link, OWN_SAG_SIGMA * usual, usual))
    for axis, harmonic, wave in product(range(1, AXES + 1), REST_HARMONICS, _WAVES):
        sigma = ECCENTRICITY_SIGMA_RAD / harmonic
        found.append(ErrorParameter(f"{wave}{harmonic}_{axis}", "rest", "rad", axis, sigma))
    found.append(ErrorParameter("sag_common", "sag", "1", 2, COMMON_SAG_SIGMA))
    for axis, wave in product((2, 3), _WAVES):
        found.append(ErrorParameter(f"{wave}up_{axis}", "rest", "rad", axis, ECCENTRICITY_SIGMA_RAD / 2))
    return tuple(found)
