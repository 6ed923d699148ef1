"""A parsed request, and a reply before it is encoded as XHTML or JSON."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any
from urllib.parse import parse_qsl, unquote


@dataclass(frozen=True)
class RwsRequest:
    """A request. `path` has no trailing and no double slash, nor what follows a semicolon (`;value`)."""

    method: str
    path: str
    query: Mapping[str, str]
    form: Mapping[str, str]
    headers: Mapping[str, str]
    body: bytes
    base: str

    @property
    def action(self) -> str | None:
        """Value of `?action=`, with which RWS 1.0 names verbs."""
        return self.query.get("action")


@dataclass(frozen=True)
class Item:
    """One resource: class, title, and values in the order they are written."""

    kind: str
    title: str
    values: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Reply:
    """A reply. `listed`: a collection, which RWS 2.0 nests differently; `page`: most items of one answer, 0 for all.

    `following`: the query of the next page. `content`: a file's bytes instead of items.
    """

    status: int = 200
    items: Sequence[Item] = ()
    listed: bool = False
    page: int = 0
    following: str = ""
    content: bytes | None = None
    media_type: str = "application/octet-stream"
    headers: Sequence[tuple[str, str]] = ()

    def cut(self, query: Mapping[str, str]) -> "Reply":
        """The page that was asked for by `start` and `limit`."""
        start, limit = (int(query[name]) if query.get(name, "").isdecimal() else 0 for name in ("start", "limit"))
        limit = min(limit or self.page, self.page)
        end = start + limit
        if not self.page or (not start and end >= len(self.items)):
            return self
        following = f"start={end}&limit={limit}" if end < len(self.items) else ""
        return replace(self, items=self.items[start:end], following=following)


DONE = Reply(204)
"""Reply to a successful POST: no body."""


def parse(method: str, raw_path: bytes, query: bytes, headers: Mapping[str, str], body: bytes, base: str) -> RwsRequest:
    path = unquote(raw_path.partition(b"?")[0].decode("latin-1")).partition(";")[0]
    path = "/" + re.sub("/+", "/", path).strip("/")
    form: dict[str, str] = {}
    if "urlencoded" in headers.get("content-type", ""):
        form = _last_of_each(body.decode("latin-1"))
    return RwsRequest(method, path, _last_of_each(query.decode("latin-1")), form, headers, body, base)


def _last_of_each(text: str) -> dict[str, str]:
    return dict(parse_qsl(text, keep_blank_values=True))
