"""Moves LAS and LAZ files without leaving integers: scale and offset are folded into the matrix.

LAS needs no library: everything but X, Y, Z and seven fields of the header is copied unchanged.
"""

import copy
from dataclasses import replace
from typing import Any

import numpy as np

from registration.errors import CloudIOError
from registration.io.durable_file import GuardedFile
from registration.io.formats.extras import las_chunks, library, open_las, translate_errors
from registration.io.formats.las import (
    HEADER_BYTES,
    LasFrame,
    LasHeader,
    move_frame,
    read_whole_header,
    require_fit,
    rewrite_header,
)
from registration.io.parallel_copy import THREADS, Span, copy_span, move_span
from registration.points.layout import Array, Layout
from registration.points.rigid_motion import IntegerMover, RigidMotion

XYZ = ("X", "Y", "Z")

BLOCK_POINTS = 200_000
"""Four chunks of usual size: lazrs packs and unpacks each in its own thread."""


def move_las(source: GuardedFile, target: GuardedFile, motion: RigidMotion, *, compress: bool) -> int:
    """Move X, Y, Z and copy every other dimension; returns the number of points. Raises CloudError's leaves."""
    header = read_whole_header(source)
    prefix, size = source.read(HEADER_BYTES), source.seek(0, 2)
    frame, matrix = move_frame(header.frame, motion, source.name)
    if header.compressed or compress:
        return _through_laspy(source, target, header, frame, matrix, compress=compress)
    movers = [IntegerMover(matrix, Layout(header.dtype, XYZ)) for _ in range(THREADS)]
    end = header.begin + header.count * header.record_bytes
    target.reserve(size)
    copy_span(source, target, 0, header.begin)
    move_span(source, target, Span(header.dtype, header.count, header.begin, header.begin), movers)
    copy_span(source, target, end, size)
    least = np.min([mover.least for mover in movers], axis=0)
    most = np.max([mover.most for mover in movers], axis=0)
    require_fit(least, most, source.name)
    bounds = (least * frame.scales + frame.offsets, most * frame.scales + frame.offsets)
    if not header.count:
        bounds = (np.zeros(3), np.zeros(3))
    target.write_at(rewrite_header(prefix, replace(frame, lower=bounds[0], upper=bounds[1]))[: header.begin], 0)
    return header.count


def _through_laspy(
    source: GuardedFile, target: GuardedFile, sound: LasHeader, frame: LasFrame, matrix: Array, *, compress: bool
) -> int:
    """Move LAZ, as source, target or both."""
    name = source.name
    reader, errors = open_las(source, sound, packed=True)
    header = copy.deepcopy(reader.header)
    header.scales, header.offsets = frame.scales, frame.offsets
    try:
        with library("laspy", "las", name).open(
            target.raw, mode="w", header=header, do_compress=compress, closefd=False
        ) as writer:
            return _pass(reader, writer, matrix, errors, name)
    except OSError as error:
        what = f"it cannot be written ({error.strerror})"
        raise CloudIOError(target.name, "file", what, "check path, rights and free space") from None


def _pass(reader: Any, writer: Any, matrix: Array, errors: tuple[type[Exception], ...], name: str) -> int:
    with translate_errors(name, "point 0", *errors):
        empty = reader.read_points(0)
    mover = IntegerMover(matrix, Layout(empty.array.dtype, XYZ))
    for _, chunk in las_chunks(reader, BLOCK_POINTS, name, errors):
        array = mover.move(chunk.array)
        require_fit(mover.least, mover.most, name)
        header = writer.header
        writer.write_points(type(empty)(array, header.point_format, header.scales, header.offsets))
    return int(reader.header.point_count)
