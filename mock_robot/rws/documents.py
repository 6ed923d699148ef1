"""Encodes replies and refusals: XHTML and JSON of RWS 1.0, XHTML and hal+json of RWS 2.0."""

import json
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

from mock_robot.rws.exchange import Item, Reply, RwsRequest
from mock_robot.rws.refusals import RwsRefused

XHTML_HEAD = '<?xml version="1.0" encoding="UTF-8"?><html xmlns="http://www.w3.org/1999/xhtml">'
SUCCESS = 294912
_WITH_STATUS = re.compile(r"/rw/(panel/.*|mastership.*|rapid/execution|rapid/tasks/[^/]+/(modules|pcp)|.*/jointtarget)")
"""Answers of 7.20 that name their status."""


@dataclass(frozen=True)
class Encoding:
    media_type: str
    reply: Callable[[Reply, RwsRequest], str]
    refusal: Callable[[RwsRefused, str], str]


def _links(base: str) -> dict[str, Any]:
    return {"base": {"href": base}}


def _object(item: Item) -> dict[str, Any]:
    return {"_type": item.kind, "_title": item.title, **item.values}


def _links_of(reply: Reply, asked: RwsRequest) -> dict[str, Any]:
    """With that of the next page, which escapes as XHTML does, as OmniCore's."""
    path = asked.path[1:]
    following = {"next": {"href": f"{path}?{escape(reply.following)}"}} if reply.following else {}
    return {**_links(asked.base), "self": {"href": path}, **following}


def _json_1(reply: Reply, asked: RwsRequest) -> str:
    items = [_object(item) for item in reply.items]
    return json.dumps({"_links": _links_of(reply, asked), "_embedded": {"_state": items}})


def _refusal_json_1(refused: RwsRefused, base: str) -> str:
    status = {"code": refused.code, "msg": refused.text}
    return json.dumps({"_links": _links(base), "_embedded": {"status": status, "_state": []}})


def _json_2(reply: Reply, asked: RwsRequest) -> str:
    document: dict[str, Any] = {"_links": _links_of(reply, asked)}
    if _WITH_STATUS.fullmatch(asked.path):
        document["status"] = {"code": SUCCESS}
    if not reply.listed:
        return json.dumps({**document, "state": [_object(item) for item in reply.items]})
    links = [{"self": {"href": f"{asked.path[1:]}/{item.title}"}} for item in reply.items]
    items = [{"_links": link, **_object(item)} for link, item in zip(links, reply.items, strict=True)]
    written = json.dumps({**document, "_embedded": {"resources": items}})
    return written.replace('"value": -', '"value": -0')  # RobotWare 7.20 writes negative arguments of its log so


def _refusal_json_2(refused: RwsRefused, base: str) -> str:
    return json.dumps({"_links": _links(base), "status": {"code": refused.code, "msg": refused.text}})


def _xhtml(reply: Reply, asked: RwsRequest) -> str:
    entries = "".join(f'<li class="{item.kind}" title="{escape(item.title)}">{_spans(item.values)}</li>'
                      for item in reply.items)  # fmt: skip
    following = f'<a href="?{escape(reply.following)}" rel="next"></a>' if reply.following else ""
    return (
        f'{XHTML_HEAD}<head><title>rws</title><base href="{asked.base}"/></head>'
        f'<body><div class="state"><a href="" rel="self"></a>{following}<ul>{entries}</ul></div></body></html>'
    )


def _refusal_xhtml(refused: RwsRefused, base: str) -> str:
    return (
        f'{XHTML_HEAD}<head><title>rws</title><base href="{base}"/></head><body><div class="status">'
        f'<span class="code">{refused.code}</span><span class="msg">{escape(refused.text)}</span></div></body></html>'
    )


def _spans(values: Mapping[str, Any]) -> str:
    return "".join(_span(name, value) for name, value in values.items())


def _span(name: str, value: Any) -> str:
    if isinstance(value, Sequence) and not isinstance(value, str):
        return f'<ul class="{name}">' + "".join(map(_write_entry, value)) + "</ul>"
    return f'<span class="{name}">{escape(str(value))}</span>'


def _write_entry(values: Mapping[str, Any]) -> str:
    head = f' class="{values["_type"]}" title="{escape(values["_title"])}"' if "_type" in values else ""
    return f"<li{head}>{_spans({name: value for name, value in values.items() if name[0] != '_'})}</li>"


def event(kind: str, href: str, group: int, item: Item) -> str:
    """Encode a change for a subscription's socket: always XHTML on one line, the link before the values."""
    return (
        f'{XHTML_HEAD}<head><title>Event</title></head><body><div class="state">'
        f'<a href="subscription/{group}" rel="group"></a><ul><li class="{kind}" title="{escape(item.title)}">'
        f'<a href="{escape(href)}" rel="self"/>{_spans(item.values)}</li></ul></div></body></html>'
    )


def subscription_created(url: str) -> str:
    """Body of a 201: the socket's address in a link element that is not self-closing."""
    return (
        f'{XHTML_HEAD}<head><title>Subscription</title></head><body><div class="state">'
        f'<a href="{url}" rel="self"></a></div></body></html>'
    )


XHTML_1 = Encoding("application/xhtml+xml", _xhtml, _refusal_xhtml)
JSON_1 = Encoding("application/json", _json_1, _refusal_json_1)
XHTML_2 = Encoding("application/xhtml+xml;v=2.0", _xhtml, _refusal_xhtml)
JSON_2 = Encoding("application/hal+json;v=2.0", _json_2, _refusal_json_2)
