"""Which picture belongs to which pose: by names in the table, numbers in the names, time, or in natural order."""

import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import product
from pathlib import PurePosixPath

import numpy as np

from calibration.documents.imports.number_tables import seconds_of
from calibration.documents.imports.pose_table import PoseTable
from calibration.documents.imports.refusal import plain, refusal
from calibration.errors import DocumentError
from calibration.transforms import Array

MAX_SHOWN = 4  # names of a list in a message; of longer ones the first and the last are shown
MAX_TIME_SHARE = 0.5
"""Largest distance of a picture's time from a pose's, as a share of the pictures' usual distance from each other."""

_DIGITS = re.compile(r"(\d+)")


@dataclass(frozen=True)
class Pairing:
    """rows (n,) of the table and images (n,), and how they were paired, in words."""

    rows: tuple[int, ...]
    images: tuple[str, ...]
    words: str


def natural(name: str) -> tuple[tuple[int, int | str], ...]:
    """The key by which view_2 comes before view_10."""
    return tuple((0, int(part)) if part.isdigit() else (1, part) for part in _DIGITS.split(name.lower()) if part)


def pair(images: Sequence[str], table: PoseTable) -> Pairing:
    """The pairs, in the order of the poses. Raises DocumentError with both lists when the counts differ."""
    images = sorted(images, key=natural)
    if table.images is not None:
        return _by_name(images, table, table.images)
    stems = {plain(PurePosixPath(image).stem.lower()): image for image in images}
    labels = [plain(label.lower()) for label in table.labels]
    if len(stems) == len(images) and set(stems) == set(labels):
        return Pairing(tuple(range(len(table))), tuple(stems[label] for label in labels), "by name")
    if (found := _by_number(images, table) or _by_time(images, table)) is not None:
        return found
    if len(images) != len(table):
        what = f"{len(images)} pictures ({shown(images)}) and {len(table)} poses ({shown(table.labels)})"
        raise refusal(table.origin, "pairs", what, "give one picture for each pose: --images, --poses", "pairs")
    return Pairing(tuple(range(len(table))), tuple(images), "in natural order")


def align_sides(robot: PoseTable, camera: PoseTable) -> PoseTable:
    """The robot's table with the camera's of the views that both have, by names, numbers or times where rows differ."""
    timed = robot.times_s is not None and camera.times_s is not None and len(robot) != len(camera)
    names = [f"{time:.6f}.s" for time in camera.times_s] if timed else list(camera.labels)  # type: ignore[union-attr]
    if tuple(names) != robot.labels and (len(robot) != len(camera) or {*names} == {*robot.labels}):
        with suppress(DocumentError):
            paired = pair(names, replace(robot, images=None))
            note = f"robot's and camera's poses are paired {paired.words}".replace("picture", "pose of the camera")
            robot = replace(robot, camera=None, notes=(*robot.notes, note)).take(paired.rows)
            camera = camera.take([names.index(name) for name in paired.images])
    return replace(robot, camera=camera)


def _by_name(images: Sequence[str], table: PoseTable, wanted: Sequence[str]) -> Pairing:
    ways: tuple[Callable[[str], str], ...] = (
        str, _last, lambda name: PurePosixPath(_last(name)).stem, lambda name: plain(_last(name).lower())
    )  # fmt: skip
    known = [(way, {way(image): image for image in images}) for way in ways]
    found = [next((one[way(name)] for way, one in known if way(name) in one), None) for name in wanted]
    missing = [name for name, image in zip(wanted, found, strict=True) if image is None]
    if missing:
        what = f"no picture of the names {shown(missing)}; there are {len(images)} ({shown(list(images))})"
        raise refusal(table.origin, "pairs", what, "name the pictures as they are called", "pairs")
    again = sorted({image for image in found if image and found.count(image) > 1}, key=natural)
    words = "by the names in the table" + (f"; of several poses each: {shown(again)}" if again else "")
    return Pairing(tuple(range(len(table))), tuple(image for image in found if image), words)


def _last(name: str) -> str:
    return PurePosixPath(name.replace("\\", "/")).name


def _by_number(images: Sequence[str], table: PoseTable) -> Pairing | None:
    """By a number in each name, counted from the end, where these are different and the same on both sides."""
    counted = _numbers([str(PurePosixPath(name).with_suffix("")) for name in images])
    n = len(table)
    counts = table.labels == tuple(str(at + 1) for at in range(n))
    for seen, posed in product(counted, _numbers(table.labels)):
        if set(seen) == set(posed) or (set(seen) > set(posed) and not counts):
            by_number = dict(zip(seen, images, strict=True))
            paired = tuple(by_number[number] for number in posed)
            left = f"; {len(images) - n} pictures without a pose are left out" if len(images) > n else ""
            return Pairing(tuple(range(n)), paired, f"by the numbers in the names{left}")
    for seen in counted if len(images) < n else []:  # some pictures were deleted
        for posed in [[*range(n)], [*range(1, n + 1)]] if counts else _numbers(table.labels):
            is_whole = not counts or not {0, n}.isdisjoint(seen)
            if set(seen) <= set(posed) and is_whole and sorted(seen) != [*range(1, len(seen) + 1)]:
                words = f"by the numbers of the pictures; {n - len(images)} poses without a picture are left out"
                return Pairing(tuple(posed.index(number) for number in seen), tuple(images), words)
    return None


def _numbers(names: Sequence[str]) -> list[list[int]]:
    """The last number of every name, the last but one ...; those that differ from name to name."""
    found = [[int(digits) for digits in reversed(_DIGITS.findall(name))] for name in names]
    places = ([numbers[place] for numbers in found] for place in range(min(map(len, found), default=0)))
    return [numbers for numbers in places if len(set(numbers)) == len(numbers)]


def _by_time(images: Sequence[str], table: PoseTable) -> Pairing | None:
    """By time, where the table has times and the pictures are named by theirs; poses without a picture are left out."""
    if table.times_s is None or len(images) < 2:
        return None
    stems = [PurePosixPath(image).stem for image in images]
    dated = [seconds_of(stem) for stem in stems]
    if any(one is None for one in dated):  # as one number, in any unit
        numbers = [re.sub(r"[^\d.]", "", stem) for stem in stems]
        if not all(re.fullmatch(r"\d{6,}(\.\d+)?|\d+\.\d+", number) for number in numbers):
            return None
        low, high, first = float(table.times_s.min()) - 60, float(table.times_s.max()) + 60, float(numbers[0])
        scale = next((one for one in (1.0, 1e-3, 1e-6, 1e-9) if low <= first * one <= high), None)
        if scale is None:
            return None
        dated = [float(number) * scale for number in numbers]
    seconds: Array = np.array(dated, float)
    rows = np.abs(seconds[:, None] - table.times_s).argmin(axis=1)
    apart = np.abs(seconds - table.times_s[rows])
    usual = float(np.median(np.diff(np.sort(seconds))))
    worst = int(apart.argmax())
    if apart[worst] > MAX_TIME_SHARE * usual or len(set(rows.tolist())) < len(rows):
        what = f"{images[worst]} is {apart[worst]:.3g} s from the nearest pose, where pictures are {usual:.3g} s apart"
        raise refusal(table.origin, "pairs", what, "give poses at the times of the pictures", "pairs")
    left = len(table) - len(rows)
    words = f"by time, at most {apart[worst]:.2g} s apart; {left} poses without a picture are left out"
    return Pairing(tuple(rows.tolist()), tuple(images), words)


def shown(names: Sequence[str]) -> str:
    """A list of names, shortened."""
    return ", ".join(names if len(names) <= MAX_SHOWN else [*names[: MAX_SHOWN - 1], "...", names[-1]])
