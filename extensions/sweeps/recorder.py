"""One sweep of a line profiler: profiles and poses in while the arm moves, points in the base frame out, to a file."""

import asyncio
from collections.abc import Awaitable, Callable
from contextlib import aclosing
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO, Literal

import numpy as np

from calibration.transforms import Array
from daemon.errors import DaemonError, StorageFull
from daemon.runtime.clock import Clock
from daemon.runtime.durable_files import create_file
from daemon.runtime.workers import Workers
from daemon.store.database import storage_errors
from drivers.errors import DeviceError, errors_of
from drivers.interfaces import PathRecorder, ProfileSource
from extensions.sweeps.errors import NothingOnPath, SweepTooLong
from extensions.sweeps.mathematics.assembler import SweepAssembler
from registration.errors import RegistrationError
from registration.profiles.profile_block import ProfileBlock

SweepState = Literal["running", "done", "failed"]

PACE_S = 0.02
"""Between two readings of the path: at most 50 a second, with 40 profiles each at 2,000 a second, 2 mm at 100 mm/s."""
MAX_SWEEP_S = 600.0
MAX_WAITING_BLOCKS = 64
POINT_BYTES = 12
SweepError = DeviceError | RegistrationError | DaemonError


@dataclass(eq=False)
class Sweep:
    """What is known of a sweep. `file`: float32 x, y, z of the points so far, in base, mm."""

    id: str
    created_at: str
    scanner: str
    calibration_id: str
    file: Path
    state: SweepState = "running"
    profiles: int = 0
    points: int = 0
    poses: int = 0
    lost_profiles: int = 0
    left_out_profiles: int = 0
    largest_gap_s: float = 0.0
    failure: SweepError | None = None
    grown: asyncio.Condition = field(default_factory=asyncio.Condition)


class SweepRecorder:
    """Carries one sweep through. Memory: the profiles that wait for poses, and the poses since the last profile."""

    def __init__(
        self,
        sweep: Sweep,
        source: ProfileSource,
        open_path: Callable[[], Awaitable[PathRecorder]],
        assembler: SweepAssembler,
        has_room: Callable[[], bool],
        clock_offset_s: float,
        clock: Clock,
        workers: Workers,
    ) -> None:
        self.sweep = sweep
        self._source, self._open_path, self._assembler = source, open_path, assembler
        self._has_room, self._offset_s, self._clock, self._workers = has_room, clock_offset_s, clock, workers
        self._arrived: asyncio.Queue[ProfileBlock] = asyncio.Queue(MAX_WAITING_BLOCKS)
        self._first_s = self._last_pose_s = self._last_profile_s = -np.inf
        self._end_s = np.inf

    def end(self) -> None:
        """Take what was measured up to now, and no more."""
        self._end_s = min(self._end_s, self._clock.monotonic_s())

    async def run(self) -> None:
        """Until `end`, or the first error, which the sweep then holds."""
        sweep = self.sweep
        try:
            await self._run()
            if sweep.profiles and not sweep.points:
                raise NothingOnPath(sweep.profiles, sweep.left_out_profiles)
            sweep.state = "done"
        except (DeviceError, RegistrationError, DaemonError) as error:
            sweep.state, sweep.failure = "failed", error
        finally:
            if sweep.state == "running":  # cancelled
                sweep.state = "failed"
            await self._announce()

    async def _run(self) -> None:
        """Raises SweepError."""
        listening = asyncio.create_task(self._listen(), name=f"profiles of sweep {self.sweep.id}")
        try:
            path = await self._open_path()
            with storage_errors(self.sweep.file):
                out = create_file(self.sweep.file)
            with out:
                await self._follow(path, listening, out)
        finally:
            listening.cancel()
            await asyncio.gather(listening, return_exceptions=True)

    async def _listen(self) -> None:
        """Pass the profiles on; waits while too many wait for poses. Raises DeviceError."""
        with errors_of("scanner"):
            async with aclosing(self._source.profiles()) as blocks:  # type: ignore[type-var]
                async for block in blocks:
                    await self._arrived.put(block)

    async def _follow(self, path: PathRecorder, listening: "asyncio.Task[None]", out: BinaryIO) -> None:
        """Read the path, and put into base what lies on it, until the end of both. Raises SweepError."""
        began_s = self._clock.monotonic_s()
        while not self._is_over():
            if listening.done() and self._arrived.empty():
                listening.result()
            if self._clock.monotonic_s() - began_s > MAX_SWEEP_S:
                raise SweepTooLong(MAX_SWEEP_S)
            with errors_of("robot"):
                times_s, poses = await path.read()
            on_path = self.sweep.poses or len(times_s)
            blocks = [self._arrived.get_nowait() for _ in range(self._arrived.qsize())] if on_path else []
            await self._workers.run(self._advance, times_s, poses, blocks, out)
            self.sweep.lost_profiles = self._source.lost_profiles
            await self._announce()
            await self._clock.sleep(PACE_S)

    def _is_over(self) -> bool:
        """Whether poses, and profiles as far as they still come, have reached the end."""
        if self._last_pose_s < self._end_s:
            return False
        return self._last_profile_s >= self._end_s or self._clock.monotonic_s() > self._end_s + self._source.lag_s

    def _advance(self, times_s: Array, poses: Array, blocks: list[ProfileBlock], out: BinaryIO) -> None:
        """Raises RegistrationError, StorageError; StorageFull before a sweep takes the room of a run."""
        sweep = self.sweep
        if len(times_s):
            if sweep.poses:
                gaps_s = np.diff(times_s, prepend=self._last_pose_s)
                sweep.largest_gap_s = max(sweep.largest_gap_s, float(gaps_s.max()))
            else:
                self._first_s = float(times_s[0])
            self._assembler.add_poses(times_s, poses)
            sweep.poses += len(times_s)
            self._last_pose_s = float(times_s[-1])
        for block in blocks:
            self._last_profile_s = float(block.times_s[-1])
            kept = self._on_path(block)
            sweep.profiles += len(block)
            sweep.left_out_profiles += len(block) - len(kept)
            self._assembler.add_profiles(kept)
        if not self._has_room():
            raise StorageFull(f"the disk of {sweep.file.parent} keeps room for a run only", "free some space there")
        for points in self._assembler.blocks():
            with storage_errors(sweep.file):
                out.write(np.ascontiguousarray(points, "<f4").data)
            sweep.points += len(points)
        with storage_errors(sweep.file):
            out.flush()

    def _on_path(self, block: ProfileBlock) -> ProfileBlock:
        """Without the profiles from before the first pose and after the end, which belong to no sweep."""
        robot_s = block.times_s + self._offset_s
        first = int(np.searchsorted(robot_s, self._first_s)) if self._first_s > -np.inf else 0
        return block[first : int(np.searchsorted(np.maximum(robot_s, block.times_s), self._end_s, side="right"))]

    async def _announce(self) -> None:
        async with self.sweep.grown:
            self.sweep.grown.notify_all()
