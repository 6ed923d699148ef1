"""Ground truth of the mock cell: one seeded, immutable description of everything in it, nominal and true.

The daemon never sees it. What an integrator knows of the cell is in `mock_robot.truth.truth_sheet`.
"""

from dataclasses import dataclass, field

import numpy as np

from calibration.camera import CameraModel
from calibration.kinematics.abb_arms import find_arm
from calibration.targets import Charuco, Target
from calibration.transforms import Array, rotation_from_vector, transform
from mock_robot.arm.built_arm import ArmClass, BuiltArm, build_arm
from mock_robot.scene.optics import Optics
from mock_robot.scene.printed_target import PrintOptions, print_target

IRB_1600 = "IRB 1600-6/1.45"

DEFAULT_TARGET = Charuco(12, 9, 20.0, 15.0, "DICT_5X5_100")
"""260 mm × 200 mm with its margin: fits A4."""

TARGET_MIDDLE_MM = (950.0, 0.0, 250.0)
PART_MIDDLE_MM = (0.0, 1550.0, 650.0)
"""The door stands on a rack at the robot's left, so that target and part are both in reach."""

TARGET_FACING_UP = np.array([[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
PART_FACING_THE_ROBOT = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])


@dataclass(frozen=True)
class CellNoise:
    """Standard deviations per axis. `scanner_mm` is along the ray at 600 mm, square on."""

    robot_translation_mm: float = 0.05
    robot_rotation_deg: float = 0.005
    scanner_mm: float = 0.04


NO_NOISE = CellNoise(0.0, 0.0, 0.0)

DEFAULT_OPTICS = Optics(black=35.0, white=175.0, blur_px=1.4, read_noise=7.0, electrons_per_level=8.0)
"""Slightly defocused lens and short exposure: detected corners have about 0.05 px of noise."""


@dataclass(frozen=True, eq=False)
class Nominal:
    """Nominal poses, as from drawings and a tape measure."""

    flange_T_camera: Array
    base_T_target: Array
    base_T_part: Array


@dataclass(frozen=True, eq=False)
class CellTruth:
    """The true cell. `flange_T_scanner` equals `flange_T_camera` when both are one device, as in seeded cells."""

    seed: int
    arm: str
    flange_T_camera: Array
    flange_T_scanner: Array
    base_T_target: Array
    base_T_part: Array
    camera: CameraModel
    target: Target
    sheet: PrintOptions
    optics: Optics
    noise: CellNoise
    nominal: Nominal = field(repr=False)
    arm_class: ArmClass = "perfect"

    @classmethod
    def from_seed(
        cls,
        seed: int,
        noise: CellNoise | None = None,
        target: Target = DEFAULT_TARGET,
        camera: CameraModel | None = None,
        optics: Optics = DEFAULT_OPTICS,
        sheet: PrintOptions | None = None,
        arm: str = IRB_1600,
        arm_class: ArmClass = "perfect",
    ) -> "CellTruth":
        """Build the cell of a seed; the same arguments give the same cell, to the last bit."""
        rng = np.random.default_rng([seed, 0x5EED])
        sheet = sheet or PrintOptions()
        nominal = Nominal(_bracket(rng), _table(rng, target, sheet), transform(PART_FACING_THE_ROBOT, PART_MIDDLE_MM))
        flange_T_camera = _displace(nominal.flange_T_camera, rng, 4.0, 1.5)
        return cls(
            seed=seed,
            arm=arm,
            flange_T_camera=flange_T_camera,
            flange_T_scanner=flange_T_camera,
            base_T_target=_displace(nominal.base_T_target, rng, 8.0, 2.0),
            base_T_part=_displace(nominal.base_T_part, rng, 10.0, 1.5),
            camera=camera or _camera(rng),
            target=target,
            sheet=sheet,
            optics=optics,
            noise=noise or CellNoise(),
            nominal=nominal,
            arm_class=arm_class,
        )

    def built_arm(self) -> BuiltArm | None:
        """The arm with its errors; None for one as drawn."""
        return None if self.arm_class == "perfect" else build_arm(find_arm(self.arm), self.arm_class, self.seed)


def _bracket(rng: np.random.Generator) -> Array:
    """A camera a few centimetres off the flange's axis, at any roll, within 20° of looking along it."""
    lean = np.radians(20.0) * np.sqrt(rng.random())
    azimuth, roll = rng.uniform(-np.pi, np.pi, 2)
    tilt = rotation_from_vector([lean * np.cos(azimuth), lean * np.sin(azimuth), 0.0])
    offset = [*rng.uniform(-60.0, 60.0, 2), rng.uniform(40.0, 110.0)]
    return transform(tilt @ rotation_from_vector([0.0, 0.0, roll]), offset)


def _table(rng: np.random.Generator, target: Target, sheet: PrintOptions) -> Array:
    """A target on the table in front of the robot, slightly turned and tilted about its nominal pose."""
    turn = rotation_from_vector([0.0, 0.0, rng.uniform(-0.35, 0.35)])
    tilt = rotation_from_vector([*rng.uniform(-0.08, 0.08, 2), 0.0])
    middle = np.append(print_target(target, sheet).outline_mm.mean(axis=0), 0.0)
    base_R_target = turn @ tilt @ TARGET_FACING_UP
    return transform(base_R_target, np.array(TARGET_MIDDLE_MM) - base_R_target @ middle)


def _displace(a_T_b: Array, rng: np.random.Generator, within_mm: float, within_deg: float) -> Array:
    shift = rng.uniform(-within_mm, within_mm, 3)
    turn = rotation_from_vector(np.radians(rng.uniform(-within_deg, within_deg, 3)))
    displaced: Array = a_T_b @ transform(turn, shift)
    return displaced


def _camera(rng: np.random.Generator) -> CameraModel:
    """1920 × 1200 on 5.86 µm pixels behind a 12 mm lens of mild barrel distortion."""
    width, height = 1920, 1200
    fx = 12.0 / 0.00586 * rng.uniform(0.99, 1.01)
    cx, cy = (width - 1) / 2 + rng.uniform(-15, 15), (height - 1) / 2 + rng.uniform(-15, 15)
    matrix = np.array([[fx, 0.0, cx], [0.0, fx * rng.uniform(0.9995, 1.0005), cy], [0.0, 0.0, 1.0]])
    distortion = np.array([rng.uniform(-0.14, -0.08), rng.uniform(0.08, 0.16), *rng.uniform(-4e-4, 4e-4, 2), 0.0])
    return CameraModel(matrix, distortion, (width, height))
