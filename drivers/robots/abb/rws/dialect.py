"""Names and formats of RWS 1.0 and 2.0 in one table, and parsing of their responses."""

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from html import unescape
from pathlib import Path
from typing import Any
from urllib.parse import parse_qsl

Call = tuple[str, Mapping[str, str]]
"""A path and its query."""
Resource = dict[str, Any]
_NUMBER = re.compile(r'("(?:\\.|[^"\\])*")|(?<![\w.])(-?)0+(?=\d)')
_CODE = re.compile(r'class="code">\s*(-?\d+)\s*<')
_MESSAGE = re.compile(r'class="msg">([^<]*)<')


@dataclass(frozen=True)
class Dialect:
    """One version of RWS. Paths begin with a slash; `query` is added to every GET.

    2.0 lists the event log oldest first; `log_headers` and `log_query` ask for the newest entries first. Of `calls` the
    one that makes a folder has a form, not a query, and masterships of cfg and rapid are both `edit` in 2.0.
    """

    version: int
    headers: Mapping[str, str]
    post_headers: Mapping[str, str]
    file_headers: Mapping[str, str]
    log_headers: Mapping[str, str]
    log_query: Mapping[str, str]
    query: Mapping[str, str]
    controller_state: str
    calls: Mapping[str, Call]
    home: str
    backups: str
    subprotocol: str

    def call(self, doing: str, **at: str) -> Call:
        """The call of `calls` that does this, at what is named: such as save_cfg, with the `domain`."""
        path, query = self.calls[doing]
        return path.format(**at), {key: value.format(**at) for key, value in query.items()}

    @property
    def name(self) -> str:
        return f"RWS {self.version}.0"

    def page(self, content: bytes) -> tuple[list[Resource], dict[str, str]]:
        """Resources of a response, and the query of the next page, {} on the last one. Raises ValueError."""
        document = json_of(content)
        embedded = document.get("_embedded", {}) if isinstance(document, dict) else None
        if not isinstance(embedded, dict):
            raise ValueError("no document of resources")
        items = embedded.get("_state") or document.get("state") or embedded.get("resources") or []
        if not isinstance(items, list) or not all(isinstance(item, dict) for item in items):
            raise ValueError("no list of resources")
        following: Any = document
        for name in ("_links", "next", "href"):
            following = following.get(name) if isinstance(following, dict) else None
        return items, dict(parse_qsl(unescape(str(following or "")).partition("?")[2]))


def json_of(content: bytes) -> Any:
    """A document. RobotWare 7.20 writes -01 in its event log, and `&amp;` in a query. Raises ValueError."""
    return json.loads(_NUMBER.sub(r"\1\2", content.decode()))


def error_in(content: bytes) -> tuple[int | None, str]:
    """ABB's code and text in the body of a refusal, JSON or XHTML; (None, "") without any."""
    text = content.decode("utf-8", "replace")
    code, message = _CODE.search(text), _MESSAGE.search(text)
    if code:
        return int(code.group(1)), message.group(1).strip() if message else ""
    try:
        document = json.loads(text)
        status = document.get("status") or document["_embedded"]["status"]
        return int(status["code"]), str(status.get("msg", ""))
    except (ValueError, KeyError, TypeError, AttributeError):
        return None, ""


_ROWS: list[dict[str, Any]] = json.loads(Path(__file__).with_name("dialects.json").read_text("utf-8"))
DIALECTS: Mapping[int, Dialect] = {row["version"]: Dialect(**row) for row in _ROWS}
