"""Profiles put into the base frame while they arrive: how many a second, beside the 2,000 that a sensor gives."""

import time

import numpy as np

from benchmarks.registration.rows import note
from calibration.transforms import rotation_from_vector, transform
from extensions.sweeps.mathematics.assembler import SweepAssembler
from registration.profiles.profile_block import ProfileBlock

SENSOR_PROFILES_S = 2_000
SECONDS = 5.0
X = transform(rotation_from_vector([0.3, -0.2, 1.1]), [40.0, -25.0, 120.0])


def main() -> None:
    print(f"\na sweep at {SENSOR_PROFILES_S:,} profiles a second, 5 % of the points missing, 250 poses a second")
    for points in (640, 1_280, 2_048, 4_096):
        wall, processor = profile_rates(points)
        note(
            f"{points:5} points a profile: {wall:8,.0f} profiles a second, {wall / SENSOR_PROFILES_S:5.1f} times the"
            f" sensor's; a second of profiles takes {SENSOR_PROFILES_S / processor:.2f} s of one core"
        )


def profile_rates(points: int) -> tuple[float, float]:
    """Profiles a second by the clock and by processor time, in pieces of 20 ms: 40 profiles and 5 poses."""
    count, random = int(SECONDS * SENSOR_PROFILES_S), np.random.default_rng(0)
    times = np.arange(count) / SENSOR_PROFILES_S
    x = np.linspace(-40, 40, points, dtype=np.float32)
    z = random.normal(300, 5, (40, points)).astype(np.float32)
    z[random.random(z.shape) < 0.05] = np.nan
    pose_times = np.arange(0, SECONDS + 0.02, 0.004)
    poses = transform(rotation_from_vector(np.outer(pose_times, [0, 0, 0.1])), np.outer(pose_times, [100.0, 0, 0]))
    sweep, spent = SweepAssembler(X), []
    for piece in range(count // 40):
        wall, processor = time.perf_counter(), time.process_time()
        sweep.add_profiles(ProfileBlock.of(times[40 * piece : 40 * piece + 40], x, z))
        sweep.add_poses(pose_times[5 * piece : 5 * piece + 5], poses[5 * piece : 5 * piece + 5])
        for _ in sweep.blocks():
            pass
        spent.append((time.perf_counter() - wall, time.process_time() - processor))
    by_clock, by_processor = (count / sum(column) for column in zip(*spent, strict=True))
    return by_clock, by_processor


if __name__ == "__main__":
    main()
