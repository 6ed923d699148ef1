"""Encodes replies and refusals: XHTML and JSON of RWS 1.0, XHTML and hal+json of RWS 2.0."""

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

from mock_robot.rws.exchange import Item, Reply
from mock_robot.rws.refusals import RwsRefused

XHTML_HEAD = '<?xml version="1.0" encoding="UTF-8"?><html xmlns="http://www.w3.org/1999/xhtml">'
SUCCESS = 294912


@dataclass(frozen=True)
class Encoding:
    """One of the four encodings. Both functions take the URL that links are relative to."""

    media_type: str
    reply: Callable[[Reply, str], str]
    refusal: Callable[[RwsRefused, str], str]


def _links(base: str) -> dict[str, Any]:
    return {"base": {"href": base}}


def _objects(items: Iterable[Item]) -> list[dict[str, Any]]:
    return [{"_type": item.kind, "_title": item.title, **item.values} for item in items]


def _links_of(reply: Reply, base: str) -> dict[str, Any]:
    """With that of the next page, which escapes as XHTML does, as OmniCore's."""
    following = {"next": {"href": "?" + escape(reply.following)}} if reply.following else {}
    return {**_links(base), **following}


def _json_1(reply: Reply, base: str) -> str:
    return json.dumps({"_links": _links_of(reply, base), "_embedded": {"_state": _objects(reply.items)}})


def _refusal_json_1(refused: RwsRefused, base: str) -> str:
    status = {"code": refused.code, "msg": refused.text}
    return json.dumps({"_links": _links(base), "_embedded": {"status": status, "_state": []}})


def _json_2(reply: Reply, base: str) -> str:
    document: dict[str, Any] = {"_links": _links_of(reply, base), "status": {"code": SUCCESS}}
    if reply.listed:
        written = json.dumps({**document, "_embedded": {"resources": _objects(reply.items)}})
        return written.replace('"value": -', '"value": -0')  # RobotWare 7.20 writes negative arguments of its log so
    return json.dumps({**document, "state": _objects(reply.items)})


def _refusal_json_2(refused: RwsRefused, base: str) -> str:
    return json.dumps({"_links": _links(base), "status": {"code": refused.code, "msg": refused.text}})


def _xhtml(reply: Reply, base: str) -> str:
    entries = "".join(f'<li class="{item.kind}" title="{escape(item.title)}">{_spans(item.values)}</li>'
                      for item in reply.items)  # fmt: skip
    following = f'<a href="?{escape(reply.following)}" rel="next"></a>' if reply.following else ""
    return (
        f'{XHTML_HEAD}<head><title>rws</title><base href="{base}"/></head>'
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
        return f'<ul class="{name}">' + "".join(f"<li>{_spans(each)}</li>" for each in value) + "</ul>"
    return f'<span class="{name}">{escape(str(value))}</span>'


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
