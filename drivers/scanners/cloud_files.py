"""Is this a whole cloud file? PLY or PCD, by its header; the points themselves are registration's business."""

import re
from typing import Literal

from drivers.errors import GarbledAnswer, NothingMeasured

CloudMediaType = Literal["application/x-ply", "application/x-pcd"]
PLY: CloudMediaType = "application/x-ply"
PCD: CloudMediaType = "application/x-pcd"
HEADER_MAX = 64 * 1024
FIX = "check that the scanner writes whole PLY or PCD files"
EMPTY_FIX = "check that the part is within the scanner's range, and its exposure"
PLY_BYTES = {
    **dict.fromkeys(("char", "uchar", "int8", "uint8"), 1),
    **dict.fromkeys(("short", "ushort", "int16", "uint16"), 2),
    **dict.fromkeys(("int", "uint", "float", "int32", "uint32", "float32"), 4),
    **dict.fromkeys(("double", "float64"), 8),
}


def whole_cloud(device: str, content: bytes) -> CloudMediaType:
    """The media type of a complete cloud file.

    Raises GarbledAnswer for a torn or foreign one, and NothingMeasured for one without a point.
    """
    try:
        if content.startswith(b"ply"):
            _require(device, content, *_ply_needs(content))
            return PLY
        if re.match(rb"\s*(#[^\n]*\.PCD|VERSION)", content):
            _require(device, content, *_pcd_needs(content))
            return PCD
    except (ValueError, KeyError, IndexError) as error:
        raise GarbledAnswer(device, f"not a whole cloud file: {error}", FIX) from error
    beginning = repr(content[:16]) if content else "nothing"
    raise GarbledAnswer(device, f"neither PLY nor PCD, it begins with {beginning}", FIX)


def _require(device: str, content: bytes, start: int, count: int, each: int) -> None:
    """`count` points behind the header: of `each` bytes, or of a line each when `each` is 0."""
    if count == 0:
        raise NothingMeasured(device, "the cloud has no points", EMPTY_FIX)
    came = len(content) - start
    if each and came < count * each:
        raise ValueError(f"{came} bytes of points came, {count * each} are announced")
    if not each:
        lines = content.count(b"\n", start) + _has_whole_last_line(content, start)
        if lines < count:
            raise ValueError(f"{lines} lines of points came, {count} are announced")


def _has_whole_last_line(content: bytes, start: int) -> bool:
    """A last line without its end counts when it has as many numbers as the first one."""
    if content.endswith(b"\n"):
        return False
    first = content[start : start + HEADER_MAX].split(b"\n", 1)[0]
    last = content[max(start, content.rfind(b"\n") + 1) :]
    return bool(last) and len(last.split()) == len(first.split())


def _ply_needs(content: bytes) -> tuple[int, int, int]:
    """(where the points begin, how many, bytes of each): the vertices, which come first in every scanner's file."""
    end = re.search(rb"\nend_header\r?\n", content[:HEADER_MAX])
    if end is None:
        raise ValueError("the PLY header has no end")
    lines = [line.split() for line in content[: end.start()].decode("ascii", "replace").splitlines()]
    form = next((words[1] for words in lines if words[:1] == ["format"] and len(words) > 1), "")
    count, each, element = 0, 0, ""
    for words in lines:
        if words[:1] == ["element"]:
            element = words[1]
            count = int(words[2]) if element == "vertex" else count
        elif words[:1] == ["property"] and element == "vertex":
            each += PLY_BYTES[words[1]]
    return end.end(), count, 0 if form == "ascii" else each


def _pcd_needs(content: bytes) -> tuple[int, int, int]:
    """(where the points begin, how many, bytes of each)."""
    end = re.search(rb"\nDATA (ascii|binary_compressed|binary)[ \t]*\r?\n", content[:HEADER_MAX])
    if end is None:
        raise ValueError("the PCD header has no DATA line")
    lines = [line.split() for line in content[: end.start()].decode("ascii", "replace").splitlines()]
    header = {words[0]: words[1:] for words in lines if words}
    count = int(header["POINTS"][0])
    if end.group(1) == b"ascii" or count == 0:
        return end.end(), count, 0
    if end.group(1) == b"binary_compressed":
        return end.end() + 8, 1, int.from_bytes(content[end.end() : end.end() + 4], "little")
    sizes = [int(size) for size in header["SIZE"]]
    counts = [int(number) for number in header.get("COUNT", ["1"] * len(sizes))]
    return end.end(), count, sum(size * number for size, number in zip(sizes, counts, strict=True))
