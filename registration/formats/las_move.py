"""LAS and LAZ from file to file: the coordinates stay integers, scale and offset are folded into the matrix."""

import copy
from typing import Any

import cv2
import numpy as np

from registration.disk import GuardedFile
from registration.errors import CloudIOError, CloudTruncated, CloudUnsupported
from registration.formats.extras import BLOCK_POINTS, library, told
from registration.layout import Array
from registration.motion import Motion

INT32_LIMIT = 2**31 - 1


def move_las(source: GuardedFile, target: GuardedFile, motion: Motion, *, compress: bool) -> int:
    """Every dimension but X, Y, Z as it was. Gives the number of points. Raises CloudError's leaves."""
    name = source.name
    laspy = library("laspy", "las", name)
    errors: tuple[type[Exception], ...] = (laspy.errors.LaspyException,)
    if compress or name.lower().endswith(".laz"):
        errors += (library("lazrs", "las", name).LazrsError,)
    with told(name, "header", *errors):
        reader = laspy.open(source.raw, closefd=False)
        header = copy.deepcopy(reader.header)
        matrix = _into_integers(header, motion)
    try:
        with laspy.open(target.raw, mode="w", header=header, do_compress=compress, closefd=False) as writer:
            return _pass(reader, writer, matrix, errors, name)
    except OSError as error:
        what = f"it cannot be written ({error.strerror})"
        raise CloudIOError(target.name, "file", what, "check path, rights and free space") from None


def _into_integers(header: Any, motion: Motion) -> Array:
    """Set the header's new scale and offset; gives (3, 4) from old integers to new ones."""
    old_scale, old_offset = np.array(header.scales, float), np.array(header.offsets, float)
    centre = (np.array(header.mins, float) + np.array(header.maxs, float)) / 2
    factor = float(np.linalg.norm(motion.matrix[:, 0]))
    scale = float(old_scale.max()) * factor
    offset = np.rint(motion.matrix[:, :3] @ centre + motion.matrix[:, 3])
    header.scales, header.offsets = [scale] * 3, offset
    linear = motion.matrix[:, :3] * old_scale / scale
    shift = (motion.matrix[:, :3] @ old_offset + motion.matrix[:, 3] - offset) / scale
    matrix: Array = np.column_stack([linear, shift])
    return matrix


def _pass(reader: Any, writer: Any, matrix: Array, errors: tuple[type[Exception], ...], name: str) -> int:
    with told(name, "point 0", *errors):
        record_type = type(reader.read_points(0))
    seen, expected = 0, int(reader.header.point_count)
    source, out = np.empty((BLOCK_POINTS, 3)), np.empty((BLOCK_POINTS, 3))
    while seen < expected:
        with told(name, f"point {seen}", *errors):
            chunk = reader.read_points(min(BLOCK_POINTS, expected - seen))
        count = len(chunk)
        if not count:
            what = f"the header promises {expected} points, the file has {seen}"
            raise CloudTruncated(name, f"point {seen}", what, "copy the whole file again")
        array = chunk.array
        for axis, column in enumerate("XYZ"):
            source[:count, axis] = array[column]
        cv2.transform(source[None, :count], matrix, out[None, :count])
        np.rint(out[:count], out=out[:count])
        if not np.abs(out[:count]).max() <= INT32_LIMIT:
            what = "the moved points do not fit LAS's 32-bit integers at this scale"
            raise CloudUnsupported(name, f"point {seen}", what, "write a PLY instead")
        for axis, column in enumerate("XYZ"):
            array[column] = out[:count, axis]
        header = writer.header
        writer.write_points(record_type(array, header.point_format, header.scales, header.offsets))
        seen += count
    return seen
