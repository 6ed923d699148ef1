"""Merges clouds into one file: each moved into the base frame, with the columns all of them have, in mm."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from calibration.transforms import Array
from registration.errors import MergeStopped
from registration.fusion.merging import EVERY_POINT, Box, Merge, Merger
from registration.io.columns import Conversion, common_layout
from registration.io.convert import move_blocks
from registration.io.reading import open_cloud
from registration.io.writing import form_of, new_cloud
from registration.points.layout import Layout, Records
from registration.points.rigid_motion import RigidMotion


@dataclass(frozen=True, eq=False)
class PlacedCloud:
    """A cloud file, its unit, and the pose of its frame."""

    file: Path
    unit: str
    base_T_cloud: Array


@dataclass(frozen=True)
class MergedCloud:
    """What a merged file holds, and what was left out of it.

    `points` are in the file. `non_finite` points had a NaN or infinite coordinate. `outliers` of `averaged` points
    stood alone. `columns_lost` are not in every cloud, or not in the file's format.
    """

    points: int
    non_finite: int
    averaged: int
    outliers: int
    columns_lost: tuple[str, ...]


OnProgress = Callable[[float], None]
"""Takes how far something is: 0 to 1, or the bytes read, as the function that calls it says."""

AVERAGING = 0.9
"""Share of a merge by voxels that is done when every point is read; the rest is outliers, normals and writing."""


def report_part(on_progress: OnProgress, before: float, share: float, done: float) -> None:
    """Call `on_progress` with the share of all that is done, where a part of it, `share`, is done by `done`."""
    on_progress(before + share * done)


def merge_clouds(
    clouds: Sequence[PlacedCloud],
    target: Path,
    calibration_id: str | None = None,
    merge: Merge = EVERY_POINT,
    stopped: Callable[[], bool] = lambda: False,
    on_progress: OnProgress = lambda so_far: None,
) -> MergedCloud:
    """Every finite point, or their averages, into `target`, by its suffix; whole under its name, or not there.

    `calibration_id`: the file says, where its format can, that it is in base, and by which calibration. `stopped` is
    asked before each block, `on_progress` called with the share that is done. Raises RegistrationError's leaves.
    """
    layout, lost = common_layout(_layout(cloud.file) for cloud in clouds)
    merger = Merger(merge, form_of(target, layout).layout, target.parent)
    share_of_byte = (1.0 if merge.voxel_mm is None else AVERAGING) / max(bytes_of(clouds), 1)
    finite = FiniteBlocks(merger.shared, stopped, merge.box_mm, lambda read: on_progress(read * share_of_byte))
    with new_cloud(target, merger.layout, calibration_id=calibration_id) as writer:
        held = Conversion.between(merger.layout, writer.form.layout)
        for block in merger.merge_views((finite.read(cloud), cloud.base_T_cloud[:3, 3]) for cloud in clouds):
            if stopped():
                raise MergeStopped
            writer.write(block if held.layout == merger.layout else held.convert(block))
    not_held = set(layout.dtype.names or ()) - set(merger.shared.dtype.names or ())
    return MergedCloud(writer.points, finite.dropped, merger.averaged, merger.left_out, (*lost, *sorted(not_held)))


class FiniteBlocks:
    """The finite points of clouds as blocks of `layout`, in base, in mm; `dropped` counts the others.

    With `box_mm` only those within it. `on_read` is called with the bytes read so far of all these files; a file that
    does not say how many points it has counts when it is read. Raises MergeStopped.
    """

    def __init__(
        self,
        layout: Layout,
        stopped: Callable[[], bool],
        box_mm: Box | None = None,
        on_read: OnProgress = lambda so_far: None,
    ) -> None:
        self._layout, self._stopped, self._box_mm, self._on_read = layout, stopped, box_mm, on_read
        self._bytes_before = 0
        self.dropped = 0

    def read(self, cloud: PlacedCloud) -> Iterator[Records]:
        motion = RigidMotion.of(cloud.base_T_cloud, cloud.unit)
        size, points = size_of(cloud.file), 0
        with open_cloud(cloud.file) as source:
            for block in move_blocks(source, motion, self._layout):
                if self._stopped():
                    raise MergeStopped
                points += len(block)
                if source.count:
                    self._on_read(self._bytes_before + size * min(points / source.count, 1.0))
                finite = self._layout.finite(block)
                kept = block if finite.all() else block[finite]
                self.dropped += len(block) - len(kept)
                if self._box_mm is not None:
                    sides = zip(self._layout.xyz, *self._box_mm, strict=True)
                    inside = [(kept[name] >= low) & (kept[name] <= high) for name, low, high in sides]
                    kept = kept[np.logical_and.reduce(inside)]
                yield kept
        self._bytes_before += size
        self._on_read(self._bytes_before)


def bytes_of(clouds: Sequence[PlacedCloud]) -> int:
    return sum(size_of(cloud.file) for cloud in clouds)


def size_of(file: Path) -> int:
    """Its bytes; 0 of one that is not there, which `open_cloud` refuses in words."""
    return file.stat().st_size if file.is_file() else 0


def _layout(file: Path) -> Layout:
    with open_cloud(file) as source:
        return source.layout
