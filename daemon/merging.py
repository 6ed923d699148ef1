"""Several clouds as one: each moved into the base frame, the columns they share written as one PLY in mm."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from calibration.transforms import Array
from registration.columns import shared_layout
from registration.files import moved_blocks
from registration.layout import Layout
from registration.motion import Motion
from registration.reading import open_cloud
from registration.writing import new_cloud


@dataclass(frozen=True, eq=False)
class PlacedCloud:
    """A cloud file, its unit, and where its frame stood."""

    file: Path
    unit: str
    base_T_cloud: Array


def write_merged(clouds: Sequence[PlacedCloud], target: Path) -> int:
    """Every finite point into `target`; answers how many. Raises RegistrationError."""
    layout, _ = shared_layout(_layout(cloud.file) for cloud in clouds)
    with new_cloud(target, layout) as writer:
        for cloud in clouds:
            motion = Motion.of(cloud.base_T_cloud, cloud.unit)
            with open_cloud(cloud.file) as source:
                for block in moved_blocks(source, motion, writer.form.layout):
                    finite = np.all([np.isfinite(block[name]) for name in writer.form.layout.xyz], axis=0)
                    writer.write(block if finite.all() else block[finite])
    return writer.points


def _layout(file: Path) -> Layout:
    with open_cloud(file) as source:
        return source.layout
