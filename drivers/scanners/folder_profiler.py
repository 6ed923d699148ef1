"""A line profiler whose program writes files of profiles to a folder while the arm moves."""

import time
from collections.abc import Callable
from pathlib import Path

from drivers.errors import AnswerTooLarge, DeviceError, GarbledAnswer
from drivers.file_thread import FileThread
from drivers.scanners.line_profiler import LineProfiler
from drivers.timing import Timing
from drivers.watched_folder import POLL_LIMIT_S, POLL_S, Sighting, files_in
from registration.errors import RegistrationError
from registration.profiles.files import read_profiles
from registration.profiles.profile_block import ProfileBlock

LIMIT_S = 60.0
MAX_BYTES = 2**30
SUFFIXES = (".npz", ".csv")
FIX = "check the folder, and that the sensor's program writes .npz or .csv files to it"


class FolderProfiler(LineProfiler):
    """Files that appear during a sweep, in the order of their names; their times are seconds since 1970 (Unix time)."""

    lag_s, fix = 3.0, FIX

    def __init__(
        self,
        folder: Path,
        timing: Timing | None = None,
        *,
        limit_s: float = LIMIT_S,
        wall_clock: Callable[[], float] = time.time,
    ) -> None:
        super().__init__(f"scanner profiles:{folder}", timing or Timing(), limit_s)
        self._folder, self._wall_clock = folder, wall_clock
        self._files = FileThread(f"reads {self.device}", self._timing)

    async def _look(self) -> None:
        known: set[Path] = set()
        before: set[Sighting] = set()
        while True:
            try:
                found = await self._files.run(lambda: files_in(self._folder, SUFFIXES), POLL_LIMIT_S)
            except TimeoutError:
                self._report.down(f"the folder was not listed in {POLL_LIMIT_S:g} s")
            except OSError as error:
                self._report.down(f"the folder cannot be read ({error.strerror})")
            else:
                self._report.up("the folder is there")
                if not self.wanted:
                    known = {one.path for one in found}
                new = [one for one in found if one.path not in known and one in before]
                for one in sorted(new, key=lambda one: one.path.name):
                    known.add(one.path)
                    await self._deliver(await self._read(one))
                before = set(found)
            await self._timing.sleep(POLL_S)

    async def _read(self, file: Sighting) -> ProfileBlock | DeviceError:
        """The profiles of a file that has stopped growing, or what is wrong with it."""
        device = f"{self.device}/{file.path.name}"
        if file.size > MAX_BYTES:
            return AnswerTooLarge(device, f"the file has {file.size} bytes", "write files of a second each")
        try:
            block = await self._files.run(lambda: read_profiles(file.path), self._limit_s)
        except TimeoutError:
            return GarbledAnswer(device, f"it was not read in {self._limit_s:g} s", FIX)
        except RegistrationError as error:
            return GarbledAnswer(device, error.what, error.fix)
        if self._offset_s is None:
            self._offset_s = self._timing.clock() - self._wall_clock()
        return ProfileBlock(block.times_s + self._offset_s, block.x_mm, block.z_mm)
