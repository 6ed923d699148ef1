"""From cloud file to cloud file at the speed of copying, in flat memory."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from registration.columns import Conversion, shared_layout
from registration.disk import GuardedFile, new_file
from registration.formats.las_move import move_las
from registration.layout import XYZ_FLOAT32, Layout, Records
from registration.motion import BlockMover, Motion
from registration.reading import PARSERS, CloudSource, open_cloud, read_header
from registration.stream import BLOCK_BYTES, CloudStream
from registration.writing import form_of, new_cloud

LAS = {".las", ".laz"}


@dataclass(frozen=True)
class Moved:
    """What went through: points, and how many of them have a coordinate that is NaN or infinite."""

    points: int
    non_finite: int


def move_file(source: Path, target: Path, motion: Motion) -> Moved:
    """`source` moved into `target`; a file of the same kind keeps every byte that is not a coordinate or normal.

    Raises CloudError's leaves; `target` is then as it was.
    """
    if {source.suffix.lower(), target.suffix.lower()} <= LAS:
        with GuardedFile.reading(source, source.name) as file, new_file(target) as out:
            return Moved(move_las(file, out, motion, compress=target.suffix.lower() == ".laz"), 0)
    form_of(target, XYZ_FLOAT32)
    if source.suffix.lower() == target.suffix.lower() and not _compressed(source):
        return _pass_through(source, target, motion)
    with open_cloud(source) as cloud:
        layout, _ = shared_layout([cloud.layout])
        mover = BlockMover(motion, cloud.layout)
        with new_cloud(target, layout) as writer:
            conversion = Conversion.between(cloud.layout, writer.form.layout)
            for block in cloud.blocks():
                writer.write(conversion.convert(mover.move(block)))
    return Moved(mover.points, mover.non_finite)


def moved_blocks(cloud: CloudSource, motion: Motion, layout: Layout) -> Iterator[Records]:
    """A cloud's blocks, moved, as blocks of common columns."""
    mover, conversion = BlockMover(motion, cloud.layout), Conversion.between(cloud.layout, layout)
    for block in cloud.blocks():
        yield conversion.convert(mover.move(block))


def _compressed(source: Path) -> bool:
    if source.suffix.lower() != ".pcd":
        return False
    with GuardedFile.reading(source, source.name) as file:
        return read_header(file, PARSERS[".pcd"], source.name).encoding == "compressed"


def _pass_through(source: Path, target: Path, motion: Motion) -> Moved:
    parser = PARSERS[source.suffix.lower()]
    stream = CloudStream.with_parser(parser, motion, source.name)
    with GuardedFile.reading(source, source.name) as file:
        header = read_header(file, parser, source.name)
        file.seek(0)
        with new_file(target) as out:
            out.write(stream.feed(file.read(header.length)))
            size = max(1, BLOCK_BYTES // header.layout.itemsize) * header.layout.itemsize
            buffer = memoryview(bytearray(size))
            while length := file.readinto(buffer):
                for part in stream.parts(buffer[:length]):
                    out.write(part)
            for part in stream.last_parts():
                out.write(part)
    return Moved(stream.points, stream.non_finite)
