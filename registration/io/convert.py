"""Moves or converts one cloud file to another in bounded memory, at the speed of copying."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from registration.io.columns import Conversion, common_layout
from registration.io.durable_file import GuardedFile, new_file
from registration.io.formats.bodies import BLOCK_BYTES, require_end
from registration.io.formats.header import CloudHeader, CloudSource
from registration.io.formats.las_move import move_las
from registration.io.formats.sections import SectionPassage
from registration.io.parallel_copy import THREADS, Span, move_span
from registration.io.reading import PARSERS, open_cloud, read_header
from registration.io.stream import CloudStream
from registration.io.writing import form_of, new_cloud
from registration.points.layout import XYZ_FLOAT32, Layout, Records
from registration.points.rigid_motion import BlockMover, RigidMotion

LAS = {".las", ".laz"}


@dataclass(frozen=True)
class MoveResult:
    """Result of a move: number of points, and how many of them have a NaN or infinite coordinate."""

    points: int
    non_finite: int


def move_file(source: Path, target: Path, motion: RigidMotion, *, durable: bool = True) -> MoveResult:
    """Move `source` to `target`; the same format keeps every byte that is not a coordinate or normal.

    `durable`: flushed to disk on return. Raises CloudError's leaves; `target` is then unchanged.
    """
    if {source.suffix.lower(), target.suffix.lower()} <= LAS:
        with GuardedFile.reading(source, source.name) as file, new_file(target, durable=durable) as out:
            return MoveResult(move_las(file, out, motion, compress=target.suffix.lower() == ".laz"), 0)
    form_of(target, XYZ_FLOAT32)
    suffix = source.suffix.lower()
    if suffix in PARSERS and suffix == target.suffix.lower() and not _is_compressed(source):
        return _pass_through(source, target, motion, durable)
    with open_cloud(source) as cloud:
        layout, _ = common_layout([cloud.layout])
        mover = BlockMover(motion, cloud.layout)
        with new_cloud(target, layout, durable=durable) as writer:
            conversion = Conversion.between(cloud.layout, writer.form.layout)
            for block in cloud.blocks():
                writer.write(conversion.convert(mover.move(block)))
    return MoveResult(mover.points, mover.non_finite)


def move_blocks(cloud: CloudSource, motion: RigidMotion, layout: Layout) -> Iterator[Records]:
    """A cloud's blocks, moved, with common columns."""
    mover, conversion = BlockMover(motion, cloud.layout), Conversion.between(cloud.layout, layout)
    for block in cloud.blocks():
        yield conversion.convert(mover.move(block))


def _is_compressed(source: Path) -> bool:
    if source.suffix.lower() != ".pcd":
        return False
    with GuardedFile.reading(source, source.name) as file:
        return read_header(file, PARSERS[".pcd"], source.name).encoding == "compressed"


def _pass_through(source: Path, target: Path, motion: RigidMotion, durable: bool) -> MoveResult:
    parser = PARSERS[source.suffix.lower()]
    with GuardedFile.reading(source, source.name) as file:
        header = read_header(file, parser, source.name)
        with new_file(target, durable=durable) as out:
            span = _span(header, file.seek(0, 2))
            if span is not None:
                return _move_records(file, out, header, span, motion)
            file.seek(0)
            return _stream_through(file, out, CloudStream(parser, motion, source.name))


def _span(header: CloudHeader, size: int) -> Span | None:
    """Position of the points; None unless they are a known number of fixed-size records at a known offset."""
    item, room = header.layout.itemsize, size - header.length
    count = header.count if header.count is not None or room % item else room // item
    if header.encoding != "binary" or header.lead or count is None:
        return None
    return Span(header.layout.dtype, count, header.length, len(header.rewritten))


def _move_records(
    file: GuardedFile, out: GuardedFile, header: CloudHeader, span: Span, motion: RigidMotion
) -> MoveResult:
    """Move the points with two threads; then copy what follows them, checked."""
    out.reserve(span.target + span.count * header.layout.itemsize)
    out.write(header.rewritten)
    movers = [BlockMover(motion, header.layout) for _ in range(THREADS)]
    move_span(file, out, span, movers)
    file.seek(span.source + span.count * header.layout.itemsize)
    out.seek(span.target + span.count * header.layout.itemsize)
    tail = SectionPassage(header.tail, header.encoding, file.name)
    while piece := file.read(BLOCK_BYTES):
        used = tail.take(memoryview(piece)) if not tail.complete else 0
        require_end(header, file.name, span.count, piece[used:])
        out.write(piece[:used])
    tail.finish()
    return MoveResult(sum(mover.points for mover in movers), sum(mover.non_finite for mover in movers))


def _stream_through(file: GuardedFile, out: GuardedFile, stream: CloudStream) -> MoveResult:
    """Move text, and clouds with elements of unknown length before the points."""
    buffer = memoryview(bytearray(BLOCK_BYTES))
    while length := file.readinto(buffer):
        for part in stream.parts(buffer[:length]):
            out.write(part)
    for part in stream.last_parts():
        out.write(part)
    return MoveResult(stream.points, stream.non_finite)
