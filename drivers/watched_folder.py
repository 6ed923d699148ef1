"""The newest complete file in a folder that another program writes to."""

import asyncio
import errno
import math
import stat
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from drivers.errors import AnswerTooLarge, DeviceError, DeviceTimeout, DeviceUnreachable, GarbledAnswer
from drivers.file_thread import FileThread
from drivers.polled_device import PolledDevice
from drivers.timing import Timing
from registration.io.regular_file import read_regular

POLL_S = 0.1
POLL_LIMIT_S = 10.0
"""A folder that takes longer to list, a network share that hangs, counts as unreachable."""
LAG_S = 0.2
"""A file's time is the end of its writing; its content is older by the exposure and the writing."""
TEMPORARY_ENDINGS = (".tmp", ".part", ".partial", ".crdownload", ".swp", "~")

Content = TypeVar("Content")


@dataclass(frozen=True)
class Sighting:
    """State of a file; it is complete when two polls agree."""

    path: Path
    size: int
    modified_ns: int


@dataclass(frozen=True)
class NewestFile:
    """A file unchanged between two polls, and the earliest moment its content can stem from."""

    sighting: Sighting
    taken_at_s: float


def files_in(folder: Path, suffixes: tuple[str, ...]) -> list[Sighting]:
    """All regular files with these suffixes; hidden and temporary names are skipped. Raises OSError.

    Links are no regular files: one may lead out of the folder, to what its writer may not read.
    """
    sightings = []
    for path in folder.iterdir():
        name = path.name.lower()
        if name.startswith(".") or name.endswith(TEMPORARY_ENDINGS) or not name.endswith(suffixes):
            continue
        with suppress(FileNotFoundError):  # renamed or removed between listing and stat
            seen = path.lstat()
            if stat.S_ISREG(seen.st_mode):
                sightings.append(Sighting(path, seen.st_size, seen.st_mtime_ns))
    return sightings


class WatchedFolder(PolledDevice):
    """Polls every 0.1 s. A file's age is its modification time, but at least the time since it was first seen.

    A subclass says which files, how long one may take, and how large it may be.
    """

    kind: str
    suffixes: tuple[str, ...]
    limit_s: float
    max_bytes: int

    def __init__(
        self,
        folder: Path,
        timing: Timing | None = None,
        *,
        image_size: tuple[int, int] | None = None,
        limit_s: float | None = None,
        max_bytes: int | None = None,
        lag_s: float = LAG_S,
        wall_clock: Callable[[], float] = time.time,
        name: str | None = None,
    ) -> None:
        """`image_size`: of a camera's pictures. What is not given is of the kind of device."""
        timing = timing or Timing()
        super().__init__(f"{name or self.kind} folder:{folder}", timing)
        self._folder, self._image_size, self._lag_s, self._wall_clock = folder, image_size, lag_s, wall_clock
        self._limit_s = self.limit_s if limit_s is None else limit_s
        self._max_bytes = self.max_bytes if max_bytes is None else max_bytes
        self._first_seen_s: dict[Sighting, float] = {}
        self._looked = False
        self._lister, self._reader = (FileThread(f"{what} {self.device}", self._timing) for what in ("lists", "reads"))
        self._newest: NewestFile | None = None

    async def newest(
        self, newer_than_s: float, understand: Callable[[str, bytes], Content]
    ) -> tuple[Content, bytes, float]:
        """`understand(device, content)` of the newest file from after `newer_than_s`, with content and time.

        An incomplete file (GarbledAnswer) is read again when it changed, until the limit.
        """
        deadline_s = max(self._timing.clock(), newer_than_s) + self._limit_s
        refused: NewestFile | None = None
        garbled: DeviceError | None = None
        while True:
            newest = self._newest
            if newest is not None and newest.taken_at_s > newer_than_s and newest != refused:
                try:
                    device = f"{self.device}/{newest.sighting.path.name}"
                    content = await self._read(device, newest.sighting)
                    understood = await asyncio.to_thread(understand, device, content)
                    return understood, content, newest.taken_at_s
                except GarbledAnswer as error:
                    refused, garbled = newest, error
            if self._timing.clock() >= deadline_s:
                raise garbled or self._nothing_fresh(newest, newer_than_s)
            await self._timing.sleep(POLL_S / 2)

    async def _read(self, device: str, sighting: Sighting) -> bytes:
        """The file's content. Raises AnswerTooLarge, GarbledAnswer, DeviceTimeout."""
        if sighting.size > self._max_bytes:
            raise self._too_large(device, f"{sighting.size} bytes, more than {self._max_bytes}")
        try:
            return await self._reader.run(
                lambda: read_regular(sighting.path, self._max_bytes, follow_links=False), self._limit_s
            )
        except TimeoutError:
            what = f"it was not read in {self._limit_s:g} s"
            raise DeviceTimeout(device, what, "check the disk or the network share") from None
        except OSError as error:
            if error.errno == errno.EFBIG:  # it grew since it was seen
                raise self._too_large(device, f"more than {self._max_bytes} bytes") from error
            raise GarbledAnswer(device, f"it cannot be read ({error.strerror})", "check the file's rights") from error

    def _too_large(self, device: str, size: str) -> AnswerTooLarge:
        return AnswerTooLarge(device, f"the file has {size}", "raise the limit in the settings, or write less")

    async def _look(self) -> None:
        while True:
            try:
                sightings = await self._lister.run(lambda: files_in(self._folder, self.suffixes), POLL_LIMIT_S)
            except TimeoutError:
                self._forget(f"the folder was not listed in {POLL_LIMIT_S:g} s")
            except OSError as error:
                self._forget(f"the folder cannot be read ({error.strerror})")
            else:
                self._report.up("the folder is there" if sightings else "the folder is there, and empty so far")
                self._note(sightings)
            await self._timing.sleep(POLL_S)

    def _forget(self, why: str) -> None:
        self._first_seen_s, self._newest, self._looked = {}, None, False
        self._report.down(why)

    def _note(self, sightings: list[Sighting]) -> None:
        """Note the newest file unchanged since the last poll; newer ones may still grow."""
        now_s, wall_ns = self._timing.clock(), self._wall_clock() * 1e9
        stood_still = [sighting for sighting in sightings if sighting in self._first_seen_s]
        for sighting in sightings:
            # A time in the future is ignored; files from before the first poll may be of any age.
            unknown = not self._looked and sighting.modified_ns > wall_ns
            self._first_seen_s.setdefault(sighting, -math.inf if unknown else now_s)
        self._first_seen_s = {sighting: self._first_seen_s[sighting] for sighting in sightings}
        self._looked = True
        newest = max(stood_still, key=lambda sighting: (sighting.modified_ns, sighting.path.name), default=None)
        if newest is None:
            self._newest = None
        elif self._newest is None or self._newest.sighting != newest:
            by_its_time_s = newest.modified_ns * 1e-9 - self._wall_clock() + now_s
            self._newest = NewestFile(newest, min(by_its_time_s, self._first_seen_s[newest]) - self._lag_s)

    def _nothing_fresh(self, newest: NewestFile | None, newer_than_s: float) -> DeviceError:
        if not self.link.connected:
            return DeviceUnreachable(self.device, self.link.detail, "check the folder's path and mount")
        fix = "check that the device goes on writing, and that its clock and this one agree"
        if newest is None:
            return DeviceTimeout(self.device, f"no file came in {self._limit_s:g} s", fix)
        late_s = newer_than_s - newest.taken_at_s
        what = f"the newest file, {newest.sighting.path.name}, is {late_s:.2f} s older than asked for"
        return DeviceTimeout(self.device, what, fix)
