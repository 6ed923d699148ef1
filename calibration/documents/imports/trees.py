"""JSON, JSON lines, YAML and XML as plain data. YAML by PyYAML's safe loader, without aliases, tags or large files.

An alias may repeat a list within a list without end; a tag may name a class. OpenCV's `!!opencv-matrix` is a mapping.
"""

import json
import re
import xml.etree.ElementTree as ElementTree
from typing import Any

import yaml

from calibration.documents.imports.refusal import decode, refusal

MAX_YAML_BYTES = 4_000_000
"""PyYAML reads about 1 MB in a second."""

MAX_XML_DEPTH = 8
"""Elements within elements; deeper ones are read as text."""

_DOCUMENTS = re.compile(r"^---[ \t]*$", re.MULTILINE)
OPENCV_MATRIX = "tag:yaml.org,2002:opencv-matrix"


class _Loader(getattr(yaml, "CSafeLoader", yaml.SafeLoader)):  # type: ignore[misc]
    """The safe loader, which knows OpenCV's matrices as well."""


_Loader.add_constructor(OPENCV_MATRIX, lambda loader, node: loader.construct_mapping(node, deep=True))


def read_json(content: bytes, origin: str) -> Any:
    """The data of a JSON text. Raises DocumentError."""
    try:
        return json.loads(decode(content, origin))
    except json.JSONDecodeError as error:
        place = f"line {error.lineno}, column {error.colno}"
        raise refusal(origin, place, f"not JSON ({error.msg})", "write the file again") from None
    except (ValueError, RecursionError) as error:
        raise refusal(origin, "file", f"beyond what is read ({error})", "write the file again") from None


def read_json_lines(content: bytes, origin: str) -> list[Any]:
    """The data of every line that is not empty. Raises DocumentError that names the line."""
    lines = [(at, line) for at, line in enumerate(decode(content, origin).splitlines(), 1) if line.strip()]
    return [read_json(line.encode(), f"{origin}: line {at}") for at, line in lines]


def read_yaml(content: bytes, origin: str) -> Any:
    """The data of a YAML text, also one that OpenCV has written; a list of several documents. Raises DocumentError."""
    if len(content) > MAX_YAML_BYTES:
        what = f"{len(content) / 1e6:.0f} MB of YAML, where {MAX_YAML_BYTES // 1_000_000} MB are read"
        raise refusal(origin, "file", what, "give the poses of the pictures only, or write JSON")
    text = decode(content, origin)
    if text.startswith("%YAML"):
        text = text.split("\n", 1)[1] if "\n" in text else ""
    documents = [part for part in _DOCUMENTS.split(text) if part.strip()]
    if len(documents) > 1:
        return [_yaml_data(part, f"{origin}: document {at}") for at, part in enumerate(documents, 1)]
    return _yaml_data(documents[0] if documents else "", origin)


def _yaml_data(text: str, origin: str) -> Any:
    try:
        if any(isinstance(event, yaml.AliasEvent) for event in yaml.parse(text, Loader=_Loader)):
            raise refusal(origin, "file", "aliases (&name, *name) are not read", "write the values out")
        return yaml.load(text, Loader=_Loader)  # noqa: S506  (a subclass of the safe loader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        place = "file" if mark is None else f"line {mark.line + 1}, column {mark.column + 1}"
        raise refusal(origin, place, f"not YAML ({error.problem})", "write the file again") from None
    except (yaml.YAMLError, ValueError, RecursionError, TypeError) as error:
        raise refusal(origin, "file", f"not YAML ({str(error)[:80]})", "write the file again") from None


def read_xml(text: str, origin: str, heading: str) -> ElementTree.Element:
    """The root of an XML text; declarations of entities, which may grow without end, are refused. DocumentError."""
    if "<!" in text.replace("<!--", ""):
        raise refusal(origin, "file", "declarations (<!...>) are not read", "write plain XML", heading)
    try:
        return ElementTree.fromstring(text.split("?>", 1)[-1].strip())  # noqa: S314  (no declarations: nothing expands)
    except (ElementTree.ParseError, ValueError, RecursionError) as error:
        raise refusal(origin, "file", f"not XML ({error})", "write the file again", heading) from None


def read_xml_tree(content: bytes, origin: str, heading: str) -> Any:
    """An XML file as mappings by tag; repeated tags are a list, and so are numbers. Raises DocumentError."""
    return _tree(read_xml(decode(content, origin), origin, heading), 0)


def _tree(element: ElementTree.Element, depth: int) -> Any:
    if not len(element) or depth > MAX_XML_DEPTH:
        text = (element.text or "").strip()
        return text.split() if len(text.split()) > 1 else text
    tree: dict[str, Any] = {}
    for child in element:
        value = _tree(child, depth + 1)
        tree.setdefault(child.tag, []).append(value)
    return {tag: values[0] if len(values) == 1 else values for tag, values in tree.items()}
