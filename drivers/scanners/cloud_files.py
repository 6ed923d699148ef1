"""Scanners that write PLY or PCD files to a folder, or serve them at a URL; and whether such a file is complete."""

import asyncio
import re
from typing import Literal

from drivers.errors import GarbledAnswer, NothingMeasured
from drivers.http_source import HttpSource
from drivers.interfaces import ScannedCloud
from drivers.watched_folder import WatchedFolder
from registration.errors import CloudError
from registration.io.formats import pcd, ply
from registration.io.formats.header import HEADER_LIMIT, CloudHeader

CloudMediaType = Literal["application/x-ply", "application/x-pcd"]
PLY: CloudMediaType = "application/x-ply"
PCD: CloudMediaType = "application/x-pcd"
FIX = "check that the scanner writes whole PLY or PCD files"
EMPTY_FIX = "check that the part is within the scanner's range, and its exposure"


def whole_cloud(device: str, content: bytes) -> CloudMediaType:
    """The media type of a complete cloud file.

    Raises GarbledAnswer for a truncated or foreign file, and NothingMeasured for one without points.
    """
    if content.startswith(b"ply"):
        media_type, parse_header = PLY, ply.parse_header
    elif re.match(rb"\s*(#[^\n]*\.PCD|VERSION)", content):
        media_type, parse_header = PCD, pcd.parse_header
    else:
        beginning = repr(content[:16]) if content else "nothing"
        raise GarbledAnswer(device, f"neither PLY nor PCD, it begins with {beginning}", FIX)
    try:
        header = parse_header(content[: HEADER_LIMIT + 1], device)
    except CloudError as error:
        raise GarbledAnswer(device, f"not a whole cloud file: {error.place}: {error.what}", FIX) from error
    missing = "its header has no end" if header is None else _missing(device, content, header)
    if missing:
        raise GarbledAnswer(device, f"not a whole cloud file: {missing}", FIX)
    return media_type


def _missing(device: str, content: bytes, header: CloudHeader) -> str:
    """Description of what is missing after the header; empty when complete. Raises NothingMeasured."""
    count = header.count or 0
    if count == 0:
        raise NothingMeasured(device, "the cloud has no points", EMPTY_FIX)
    if header.encoding == "text":
        lines = content.count(b"\n", header.length) + _has_whole_last_line(content, header.length)
        return f"{lines} lines of points came, {count} are announced" if lines < count else ""
    came, announced = len(content) - header.length, header.body_length or count * header.layout.itemsize
    if header.encoding == "compressed":  # both lengths of the columns, four bytes each, then the columns
        announced = 8 + int.from_bytes(content[header.length : header.length + 4], "little")
    return f"{came} bytes of points came, {announced} are announced" if came < announced else ""


def _has_whole_last_line(content: bytes, start: int) -> bool:
    """Whether the last line is complete: without a line end it must have as many numbers as the first."""
    if content.endswith(b"\n"):
        return False
    first = content[start : start + HEADER_LIMIT].split(b"\n", 1)[0]
    last = content[max(start, content.rfind(b"\n") + 1) :]
    return bool(last) and len(last.split()) == len(first.split())


class FolderScanner(WatchedFolder):
    """drivers.interfaces.Scanner. A cloud is as old as its file plus `lag_s` for scanning and writing."""

    kind, suffixes, limit_s, max_bytes = "scanner", (".ply", ".pcd"), 60.0, 2**30

    async def scan(self, newer_than_s: float) -> ScannedCloud:
        """The newest complete cloud from after `newer_than_s`; raises a DeviceError."""
        media_type, content, taken_at_s = await self.newest(newer_than_s, whole_cloud)
        return ScannedCloud(content, media_type, taken_at_s)


PICTURES_AND_PAGES = ("text/html", "image/")


class HttpScanner(HttpSource):
    """drivers.interfaces.Scanner. The response may state a cloud's age; otherwise it was scanned after the request."""

    kind, max_bytes = "scanner", 2**30
    limit_s = 60.0  # a structured-light scan of one view takes seconds, its transfer as long

    async def scan(self, newer_than_s: float) -> ScannedCloud:
        fetched = await self.fetch(newer_than_s)
        if fetched.media_type.startswith(PICTURES_AND_PAGES):
            what = f"it answered with {fetched.media_type}, not with a cloud"
            raise GarbledAnswer(self.device, what, "check the URL")
        media_type = await asyncio.to_thread(whole_cloud, self.device, fetched.content)
        return ScannedCloud(fetched.content, media_type, fetched.taken_at_s)
