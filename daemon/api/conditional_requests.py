"""ETag and If-Match of the active calibration (RFC 9110, 8.8.3 and 13.1), against lost updates."""

import re
from collections.abc import Sequence
from typing import Annotated, Any

from fastapi import Header

from calibration.errors import DocumentProblem
from daemon.api.http_errors import InvalidRequest

TAG = re.compile(r'"applied-([0-9]{1,18})"')
ANY = range(1, 2**62)
"""Every sequence number from 1: "*" does not match while nothing is active."""

LIST = re.compile(r'^\s*(\*|(W/)?"[\x21\x23-\x7e]*"(\s*,\s*(W/)?"[\x21\x23-\x7e]*")*)\s*$')

IfMatch = Annotated[
    str | None,
    Header(max_length=500, description='ETag of GET /calibrations/current; "*": whatever is active',
           examples=['"applied-7"']),
]  # fmt: skip
IfNoneMatch = Annotated[str | None, Header(max_length=500, description="ETag of an earlier answer: 304 when unchanged")]

ETAG_HEADER: dict[str, Any] = {"ETag": {"schema": {"type": "string"}, "description": "changes with what is active"}}
UNCHANGED: dict[str, Any] = {"description": "The same as before", "headers": ETAG_HEADER}


def tag_of(sequence: int) -> str:
    """The ETag of the calibration that was applied as number `sequence`."""
    return f'"applied-{sequence}"'


def parse_if_none_match(header: str) -> list[str]:
    """The tags of If-None-Match, without W/ for the weak comparison."""
    return [part.strip().removeprefix("W/") for part in header.split(",")]


def parse_if_match(if_match: str | None) -> Sequence[int] | None:
    """The sequence numbers that If-Match allows; None for any. Raises InvalidRequest.

    An unknown or weak tag matches nothing.
    """
    if if_match is None:
        return None
    if if_match.strip() == "*":
        return ANY
    if not LIST.match(if_match):
        fix = 'send the ETag as it came, with its quotes: "applied-7"'
        raise InvalidRequest([DocumentProblem("header.If-Match", "not a list of entity tags", fix)])
    return [int(number) for tag in if_match.split(",") for number in TAG.findall(tag) if "W/" not in tag]
