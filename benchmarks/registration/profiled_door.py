"""The mock cell's door swept over by a line profiler at 100 mm/s: distances of the points from the true surface.

The profiler and its clock are first calibrated from sweeps over a sphere, with the same arm.
"""

import argparse

import numpy as np

from calibration.kinematics.abb_arms import find_arm
from calibration.kinematics.arm import UnreachablePoseError
from calibration.transforms import Array, difference, inverse, map_points, rotation_from_vector, transform
from extensions.sweeps.mathematics.assembler import SweepAssembler
from extensions.sweeps.mathematics.profiler import ArtefactSweep, solve_profiler
from mock_robot.arm.paths import LinePath
from mock_robot.arm.simulated_arm import ArmMotion, ArmNoise, plan_motion
from mock_robot.scene.part import DOOR
from mock_robot.scene.scanner_view import ProfilerModel, profile_door
from mock_robot.truth.truth import TARGET_MIDDLE_MM, CellTruth
from registration.profiles.profile_block import ProfileBlock
from registration.profiles.robot_path import RobotPath
from tests.simulated.door_sweeps import STAND_OFF_MM, base_T_profiler_before_door
from tests.support.profiled_sphere import profile_sphere

SPEED_MM_S = 100.0
PROFILES_HZ, POSES_HZ = 100.0, 50.0
RADIUS_MM = 40.0
OFFSET_S = 0.042
JITTER_S = 0.0005
ARMS = {"good": (0.05, 0.005), "usual": (0.15, 0.015)}
SPHERE_SWEEPS = 12
HALVES_MM = ((-640.0, 10.0), (640.0, -10.0))
ROWS_MM = (-190.0, 0.0, 180.0)
BAR_MM = 0.3


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cells", type=int, default=2)
    parser.add_argument("--arms", nargs="+", choices=list(ARMS), default=list(ARMS))
    options = parser.parse_args()
    print(f"mock door in sweeps at {SPEED_MM_S:g} mm/s, sensor's clock {OFFSET_S * 1e3:g} ms behind")
    print(f"{'arm':<18}{'cell':>5}{'X':>19}{'clock':>9}{'points':>10}{'RMS':>8}{'true X':>8}{'clock ignored':>15}  mm")
    for name in options.arms:
        mm, deg = ARMS[name]
        worst = max(_cell(mm, deg, seed) for seed in range(1, options.cells + 1))
        print(
            f"{name:<18}worst {worst:.3f} mm RMS: {'within' if worst <= BAR_MM else 'NOT within'} {BAR_MM} mm",
            flush=True,
        )


def _cell(mm: float, deg: float, seed: int) -> float:
    cell = _Cell(seed, mm, deg)
    solution = solve_profiler(cell.sphere_sweeps())
    assert solution.mount_T_camera is not None, solution.findings
    assert solution.clock_offset is not None
    x, offset_s = solution.mount_T_camera, solution.clock_offset.offset_s
    sweeps = cell.door_sweeps()
    rms, points = cell.deviation(sweeps, x, offset_s)
    best, _ = cell.deviation(sweeps, cell.truth.flange_T_scanner, OFFSET_S)
    ignored, _ = cell.deviation(sweeps, x, 0.0)
    off_mm, off_rad = difference(x, cell.truth.flange_T_scanner)
    print(
        f"{f'{mm} mm {deg} deg':<18}{seed:>5}{f'{off_mm:.2f} mm {np.degrees(off_rad):.3f} deg':>19}"
        f"{(offset_s - OFFSET_S) * 1e3:>6.2f} ms{points:>10,}{rms:8.3f}{best:8.3f}{ignored:15.3f}",
        flush=True,
    )
    return rms


class _Cell:
    """The cell of a seed with a profiler in the scanner's place; each sweep is one move of the arm."""

    def __init__(self, seed: int, mm: float, deg: float) -> None:
        self.truth = CellTruth.from_seed(seed)
        self.random = np.random.default_rng([seed, 18])
        self._arm = find_arm(self.truth.arm)
        self._noise = ArmNoise(mm, float(np.radians(deg)), 1000 + seed)
        self._profiler = ProfilerModel()
        self._sweeps = 0

    def sphere_sweeps(self) -> list[ArtefactSweep]:
        """Over a sphere on the table, from poses planned with the nominal X."""
        centre = np.array(TARGET_MIDDLE_MM) + self.random.normal(0, 5, 3)
        found: list[ArtefactSweep] = []
        for _ in range(20 * SPHERE_SWEEPS):
            if len(found) == SPHERE_SWEEPS:
                break
            turn = rotation_from_vector([np.pi, 0, 0]) @ rotation_from_vector(
                [0, 0, self.random.uniform(-np.pi, np.pi)]
            )
            rotation = turn @ rotation_from_vector(self.random.normal(0, 0.35, 3))
            aim = np.array([self.random.normal(0, 35), 0.0, STAND_OFF_MM + self.random.normal(0, 30)])
            ends = [
                transform(rotation, centre - rotation @ (aim + np.array([0.0, y, 0.0])))
                for y in self.random.permutation([-75.0, 75.0])
            ]
            sweep = self._drive(ends)
            if sweep is None:
                continue
            times, path, base_T_profiler = sweep
            x, z = profile_sphere(self._profiler, inverse(base_T_profiler), centre, RADIUS_MM, self.random)
            found.append(ArtefactSweep(ProfileBlock.of(times, x, z), path, "sphere", RADIUS_MM))
        return found

    def door_sweeps(self) -> list[tuple[ProfileBlock, RobotPath]]:
        """Three rows along the door in two halves, from poses planned with the nominal X and rack."""
        found = []
        for y in ROWS_MM:
            for begin, end in HALVES_MM:
                ends = [base_T_profiler_before_door(self.truth, x, y) for x in (begin, end)]
                sweep = self._drive(ends) or self._drive([pose @ HALF_TURN for pose in ends])
                if sweep is None:
                    print(f"         (the arm cannot sweep row {y:g} mm from {begin:g} to {end:g} mm)")
                    continue
                times, path, base_T_profiler = sweep
                x, z = profile_door(self._profiler, inverse(self.truth.base_T_part) @ base_T_profiler, self.random)
                found.append((ProfileBlock.of(times, x, z), path))
        return found

    def deviation(self, sweeps: list[tuple[ProfileBlock, RobotPath]], x: Array, offset_s: float) -> tuple[float, int]:
        """RMS distance from the true skin in mm, and the number of points, of sweeps streamed in pieces of 0.1 s."""
        squares, count, part_T_base = [], 0, inverse(self.truth.base_T_part)
        for block, path in sweeps:
            assembler = SweepAssembler(x, offset_s)
            assembler.add_poses(path.times_s, path.base_T_flange)
            for start in range(0, len(block), 10):
                assembler.add_profiles(block[start : start + 10])
                for points in assembler.blocks():
                    count += len(points)
                    squares.append(DOOR.deviation(map_points(part_T_base, points[::40])) ** 2)
            assembler.require_finished()
        return float(np.sqrt(np.mean(np.concatenate(squares)))), count

    def _drive(self, ends: list[Array]) -> tuple[Array, RobotPath, Array] | None:
        """Sensor times (n,), the reported path, and the true base_T_profiler (n, 4, 4) of one straight move.

        `ends`: base_T_profiler with the nominal X. None where the arm cannot follow.
        """
        first, last = (pose @ inverse(self.truth.nominal.mount_T_camera) for pose in ends)
        try:
            begin = min(self._arm.inverse(first), key=lambda joints: float(np.abs(joints).max()))
            end = self._arm.nearest(last, begin)
        except UnreachablePoseError:
            return None
        motion = plan_motion(self._arm, begin, end, SPEED_MM_S, True, 1.0)
        if not isinstance(motion.path, LinePath) or motion.path.reachable_fraction < 1.0:
            return None
        self._sweeps += 1
        at = np.arange(1.0, motion.end_s, 1 / PROFILES_HZ)
        pose_times = np.arange(0.8, motion.end_s + 0.2, 1 / POSES_HZ)
        path = RobotPath.of(
            pose_times + self.random.normal(0, JITTER_S, len(pose_times)), _poses_along(motion, motion.path, pose_times)
        )
        true = _poses_along(motion, motion.path, at) @ self._noise.flange_T_true(self._sweeps)
        return at - OFFSET_S, path, true @ self.truth.flange_T_scanner


def _poses_along(motion: ArmMotion, path: LinePath, times: Array) -> Array:
    """base_T_flange (n, 4, 4) as the controller reports it."""
    return np.array([path.base_T_flange_at(motion.along_at(float(time))) for time in times])


HALF_TURN = transform(np.diag([-1.0, -1.0, 1.0]), np.zeros(3))

if __name__ == "__main__":
    main()
