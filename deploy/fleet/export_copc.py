"""Write a LAS or LAZ cloud as COPC, for viewers that load parts of it: `export_copc.py CLOUD OUT.copc.laz`.

Needs `pip install 'handeyed[copc]'`: laspy reads, copclib writes the octree (https://copc.io). The cloud is held in
memory, about 150 bytes a point. Coordinates, colour, intensity, time and the other standard fields stay as they are,
to the last digit; fields that a writer added are left out.
"""

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from registration.io.regular_file import require_replaceable

try:
    import copclib
    import laspy
except ImportError as error:
    sys.exit(f"{error.name} is not installed: pip install 'handeyed[copc]'")

CELLS = 128
"""A node holds one point of each of so many cells along an edge; the other points lie below it."""

MAX_LEAF_POINTS = 20_000
"""A node with fewer holds them all."""

MAX_LEVEL = 13
"""With it a cell's number fits into 20 bits an axis."""

KEY = np.array([1 << 40, 1 << 20, 1])
"""Three such numbers as one."""

Positions = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]


def nodes_of(shares: Positions) -> Iterator[tuple[int, Indices, Indices]]:
    """Level, place (3,) and points' indices of each node of the octree. `shares` (n, 3): positions in it, 0 to 1.

    Every point is in one node: of each cell the first one in order, the others in a child.
    """
    left = np.arange(len(shares))
    for level in range(MAX_LEVEL + 1):
        cells = np.minimum((shares[left] * (CELLS << level)).astype(np.int64), (CELLS << level) - 1)
        places = cells // CELLS
        _, of_node, sizes = np.unique(places @ KEY, return_inverse=True, return_counts=True)
        held = (sizes <= MAX_LEAF_POINTS)[of_node] | (level == MAX_LEVEL)
        held[np.unique(cells @ KEY, return_index=True)[1]] = True
        chosen = np.flatnonzero(held)
        chosen = chosen[np.argsort(of_node[chosen], kind="stable")]
        for one in np.split(chosen, np.flatnonzero(np.diff(of_node[chosen])) + 1):
            yield level, places[one[0]], left[one]
        left = left[~held]
        if not len(left):
            return


def export_copc(cloud: Path, out: Path) -> int:
    """Write `out`; returns its number of points."""
    with laspy.open(cloud) as reader:
        read: Any = reader.read()
    coloured = "red" in read.point_format.dimension_names
    header = laspy.LasHeader(version="1.4", point_format=7 if coloured else 6)
    header.scales, header.offsets = read.header.scales, read.header.offsets
    points = laspy.ScaleAwarePointRecord.zeros(len(read.points), header=header)
    points.copy_fields_from(read.points)
    config = copclib.CopcConfigWriter(
        header.point_format.id, copclib.Vector3(*header.scales), copclib.Vector3(*header.offsets)
    )
    position = np.column_stack([points.x, points.y, points.z])
    low, high = position.min(axis=0), position.max(axis=0)
    edge = max(float((high - low).max()), 1e-6)
    about = config.copc_info
    about.center_x, about.center_y, about.center_z = (float(each) for each in low + edge / 2)
    about.halfsize, about.spacing = edge / 2, edge / CELLS
    config.las_header.min, config.las_header.max = copclib.Vector3(*low), copclib.Vector3(*high)
    writer = copclib.FileWriter(str(out), config)
    for level, (x, y, z), indices in nodes_of((position - low) / edge):
        content = copclib.VectorChar(points.array[indices].view(np.int8))
        writer.AddNode(copclib.VoxelKey(level, int(x), int(y), int(z)), content)
    writer.Close()
    return len(position)


def main(given: Path, wanted: Path) -> None:
    """Write `wanted` whole, or not at all. Exits in words where it is no file or the cloud is none."""
    part = wanted.with_name(f".{wanted.name}.part")
    try:
        require_replaceable(wanted)
        count = export_copc(given, part)
        part.replace(wanted)
    except (OSError, laspy.errors.LaspyException) as error:
        part.unlink(missing_ok=True)
        sys.exit(f"{given} to {wanted}: {error}")
    sys.stdout.write(f"{wanted}: {count:,} points\n")


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit("export_copc.py CLOUD OUT.copc.laz")
    main(Path(sys.argv[1]), Path(sys.argv[2]))
