"""Cloud files written and read whole."""

from pathlib import Path

import numpy as np

from registration.io.columns import Conversion, common_layout
from registration.io.reading import open_cloud
from registration.io.writing import new_cloud
from registration.points.layout import Layout, Records


def read(path: Path, common: bool = False) -> Records:
    """Every point; `common`: under the common names."""
    with open_cloud(path) as source:
        conversion = Conversion.between(source.layout, common_layout([source.layout])[0])
        blocks = [conversion.convert(block) if common else block.copy() for block in source.blocks()]
    return np.concatenate(blocks) if blocks else np.empty(0)


def write(path: Path, layout: Layout, records: Records) -> None:
    with new_cloud(path, layout) as writer:
        for start in range(0, len(records), 700):
            writer.write(records[start : start + 700])
