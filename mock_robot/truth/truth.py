"""Ground truth of the mock cell: one seeded, immutable description of everything in it, nominal and true.

The daemon never sees it. What an integrator knows of the cell is in `mock_robot.truth.truth_sheet`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import exp

import numpy as np

from calibration.camera import CameraModel
from calibration.kinematics.abb_arms import find_arm
from calibration.problem import Setup, anchor_T_mount_of
from calibration.targets import Charuco, Target
from calibration.transforms import Array, inverse, rotation_from_vector, transform
from mock_robot.arm.built_arm import ArmClass, BuiltArm, build_arm
from mock_robot.cabinet.cabinet import Mounting
from mock_robot.scene.optics import Optics
from mock_robot.scene.printed_target import PrintOptions, print_target


@dataclass(frozen=True)
class CameraWarming:
    """A camera that warms up from `cold_c` towards `warm_c`, while its image shifts: after `pictures` 63 % of the way.

    `px_per_k`: shift of the image (u, v). `reported`: whether the camera gives its temperature with each picture.
    """

    cold_c: float = 32.0
    warm_c: float = 47.0
    pictures: float = 8.0
    px_per_k: tuple[float, float] = (0.1, -0.05)
    reported: bool = True

    def temperature_c(self, number: int) -> float:
        """While picture `number` is taken, the first one being 1."""
        return self.warm_c + (self.cold_c - self.warm_c) * exp(-(number - 1) / self.pictures)

    def camera(self, cold: CameraModel, number: int) -> CameraModel:
        """The camera that takes picture `number`."""
        matrix = cold.matrix.copy()
        matrix[:2, 2] += np.array(self.px_per_k) * (self.temperature_c(number) - self.cold_c)
        return replace(cold, matrix=matrix)


IRB_1600 = "IRB 1600-6/1.45"

DEFAULT_TARGET = Charuco(12, 9, 20.0, 15.0, "DICT_5X5_100")
"""260 mm × 200 mm with its margin: fits A4."""

TARGET_MIDDLE_MM = (950.0, 0.0, 250.0)
PART_MIDDLE_MM = (0.0, 1550.0, 650.0)
"""The door stands on a rack at the robot's left, so that target and part are both in reach."""

STAND_MM, STAND_AIM_MM = np.array([1450.0, 0.0, 1150.0]), np.array([980.0, 0.0, 750.0])
"""A camera on a stand, and where it looks: to where the arm holds the target up."""

HOLDER_MM = np.array([0.0, 0.0, 30.0])
"""The target's middle on the flange."""

PART_DISTANCE_MM = 700.0
"""The part's middle from the camera on the stand."""

CAMERA_TURN, CAMERA_STEP_MM = rotation_from_vector([0.10, -0.06, 0.5]), np.array([35.0, -20.0, 5.0])
SCANNER_STEP_MM = np.array([-40.0, 15.0, -10.0])
"""Of each further camera from the first; of each further scanner from the last camera, as docs/cells.md has it."""

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
    """Nominal poses, as from drawings and a tape measure; `mount` and `anchor` as in `calibration.problem`."""

    mount_T_camera: Array
    anchor_T_target: Array
    base_T_part: Array


@dataclass(frozen=True, eq=False)
class CellTruth:
    """The true cell. Camera and scanner are one device in seeded cells.

    `mount_T_camera`, `anchor_T_target`: as in `calibration.problem`, by the set-up. `further_cameras`: mount_T_camera
    of cameras of the same lens, by name; `further_scanners`: mount_T_scanner of scanners that see the target, by name.
    `warming`: of the camera, None for one that is warm. `scara`: the arm turns its flange about the vertical only.
    """

    seed: int
    arm: str
    setup: Setup
    mount_T_camera: Array
    mount_T_scanner: Array
    anchor_T_target: Array
    base_T_part: Array
    camera: CameraModel
    target: Target
    sheet: PrintOptions
    optics: Optics
    noise: CellNoise
    nominal: Nominal = field(repr=False)
    arm_class: ArmClass = "perfect"
    further_cameras: Mapping[str, Array] = field(default_factory=dict)
    further_scanners: Mapping[str, Array] = field(default_factory=dict)
    warming: CameraWarming | None = None
    mounting: Mounting = field(default_factory=Mounting)
    scara: bool = False

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
        setup: Setup = "eye-in-hand",
    ) -> "CellTruth":
        """Build the cell of a seed; the same arguments give the same cell, to the last bit."""
        rng = np.random.default_rng([seed, 0x5EED])
        sheet = sheet or PrintOptions()
        part = transform(PART_FACING_THE_ROBOT, PART_MIDDLE_MM)
        nominal = Nominal(_bracket(rng), _table(rng, target, sheet), part)
        if setup == "eye-to-hand":
            nominal = _with_camera_on_stand(target, sheet)
        mount_T_camera = _displace(nominal.mount_T_camera, rng, 4.0, 1.5)
        return cls(
            seed=seed,
            arm=arm,
            setup=setup,
            mount_T_camera=mount_T_camera,
            mount_T_scanner=mount_T_camera,
            anchor_T_target=_displace(nominal.anchor_T_target, rng, 8.0, 2.0),
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

    @property
    def flange_T_camera(self) -> Array:
        """Of a camera on the flange."""
        return self._of("eye-in-hand", self.mount_T_camera)

    @property
    def flange_T_scanner(self) -> Array:
        """Of a scanner on the flange."""
        return self._of("eye-in-hand", self.mount_T_scanner)

    @property
    def base_T_target(self) -> Array:
        """Of a target beside the robot."""
        return self._of("eye-in-hand", self.anchor_T_target)

    def beside(self, cameras: Sequence[str], scanners: Sequence[str]) -> "CellTruth":
        """The cell with cameras of these names beside its camera, and scanners beside the last of them."""
        placed = [self.mount_T_camera @ transform(CAMERA_TURN, n * CAMERA_STEP_MM) for n in range(1, len(cameras) + 1)]
        last = [self.mount_T_camera, *placed][-1]
        scanning = [last @ transform(np.eye(3), n * SCANNER_STEP_MM) for n in range(1, len(scanners) + 1)]
        named = dict(zip(cameras, placed, strict=True)), dict(zip(scanners, scanning, strict=True))
        return replace(self, further_cameras=named[0], further_scanners=named[1])

    def of_camera(self, name: str) -> "CellTruth":
        """The cell with this further camera in the place of its camera."""
        return replace(self, mount_T_camera=self.further_cameras[name])

    def at_picture(self, number: int) -> "CellTruth":
        """The cell with its camera as warm as it is while it takes picture `number`."""
        return self if self.warming is None else replace(self, camera=self.warming.camera(self.camera, number))

    def scanner_T_target(self, name: str, base_T_flange: Array) -> Array:
        """(4, 4) of a further scanner, while the flange is there."""
        return replace(self, mount_T_camera=self.further_scanners[name]).camera_T_target(base_T_flange)

    def camera_T_target(self, base_T_flange: Array) -> Array:
        """(4, 4) while the flange is there."""
        return inverse(anchor_T_mount_of(self.setup, base_T_flange) @ self.mount_T_camera) @ self.anchor_T_target

    def base_T_scanner(self, base_T_flange: Array) -> Array:
        """(4, 4) while the flange is there."""
        scanner: Array = self.mount_T_scanner if self.setup == "eye-to-hand" else base_T_flange @ self.mount_T_scanner
        return scanner

    def _of(self, setup: Setup, pose: Array) -> Array:
        assert self.setup == setup, f"this cell is {self.setup}"
        return pose


def _with_camera_on_stand(target: Target, sheet: PrintOptions) -> Nominal:
    """A camera on a stand in front of the robot, the target on the flange, and the part where the camera looks."""
    ahead = np.array(STAND_AIM_MM) - STAND_MM
    ahead /= np.linalg.norm(ahead)
    right = np.array([0.0, 1.0, 0.0])
    base_T_camera = transform(np.column_stack([right, np.cross(ahead, right), ahead]), STAND_MM)
    middle = np.append(print_target(target, sheet).outline_mm.mean(axis=0), 0.0)
    flange_T_target = transform(TARGET_FACING_UP, HOLDER_MM - TARGET_FACING_UP @ middle)
    part = base_T_camera @ transform(np.diag([1.0, -1.0, -1.0]), [0.0, 0.0, PART_DISTANCE_MM])
    return Nominal(base_T_camera, flange_T_target, part)


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
