"""Several clouds as one: each moved into the base frame, the coordinates written as one binary PLY in mm."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from calibration.transforms import Array
from registration.formats.bodies import decoder_of
from registration.formats.detect import parser_of
from registration.formats.header import CloudHeader
from registration.formats.sections import SectionPassage
from registration.layout import Records
from registration.motion import BlockMover, Motion

PIECE_BYTES = 1 << 18
HEADER = (
    "ply\nformat binary_little_endian 1.0\ncomment robot base frame, mm\nelement vertex {count:012d}\n"
    "property float x\nproperty float y\nproperty float z\nend_header\n"
)


@dataclass(frozen=True, eq=False)
class PlacedCloud:
    """A cloud file, its unit, and where its frame stood."""

    file: Path
    media_type: str
    unit: str
    base_T_cloud: Array


def write_merged(clouds: Iterable[PlacedCloud], out: BinaryIO) -> int:
    """Write every finite point; answers how many. `out` must be able to seek. Raises RegistrationError, OSError."""
    out.write(HEADER.format(count=0).encode())
    count = 0
    for cloud in clouds:
        for points in _moved(cloud):
            finite = points[np.isfinite(points).all(axis=1)]
            out.write(finite.tobytes())
            count += len(finite)
    out.seek(0)
    out.write(HEADER.format(count=count).encode())
    return count


def _moved(cloud: PlacedCloud) -> Iterator[NDArray[np.float32]]:
    """Blocks (n, 3) in the base frame, mm."""
    name = cloud.file.name
    with cloud.file.open("rb") as file:
        header, rest = _header(cloud, file)
        mover = BlockMover(Motion.of(cloud.base_T_cloud, cloud.unit), header.layout)
        lead, decoder = SectionPassage(header.lead, header.encoding, name), decoder_of(header, name)
        while rest and not decoder.done:
            data = memoryview(rest)
            if not lead.done:
                data = data[lead.take(data) :]
            if lead.done:
                for block in decoder.take(data):
                    yield _coordinates(mover.move(block if block.flags.writeable else block.copy()), header)
            rest = file.read(PIECE_BYTES)
        for block in decoder.finish():
            yield _coordinates(mover.move(block.copy()), header)


def _header(cloud: PlacedCloud, file: BinaryIO) -> tuple[CloudHeader, bytes]:
    """The header, and the bytes after it that were read already."""
    parse, content = parser_of(cloud.media_type, cloud.file.name), b""
    while (header := parse(content, cloud.file.name)) is None:
        content += file.read(PIECE_BYTES)
    return header, content[header.length :] or file.read(PIECE_BYTES)


def _coordinates(block: Records, header: CloudHeader) -> NDArray[np.float32]:
    return np.stack([block[name] for name in header.layout.xyz], axis=1).astype("<f4")
