"""JSON, JSON lines, YAML, XML and Python's literals as plain data. YAML by PyYAML's safe loader, with no alias or tag.

An alias may repeat a list within a list without end; a tag may name a class. OpenCV's `!!opencv-matrix` is a mapping.
"""

import ast
import contextlib
import json
import re
import xml.etree.ElementTree as ElementTree
from typing import Any

import yaml

from calibration.documents.imports.refusal import DAMAGED, decode, refusal

MAX_YAML_BYTES, MAX_SOURCE_BYTES = 4_000_000, 1_000_000  # PyYAML and Python's parser read about 1 MB in a second
MAX_XML_DEPTH = 8  # elements within elements; deeper ones are read as text

_ARRAY = re.compile(r"\b(?:np|numpy)\.(?:array|asarray|matrix)\b|,\s*dtype\s*=\s*[\w.]+")
_DOCUMENTS = re.compile(r"^---[ \t]*$", re.MULTILINE)
_SPARE = re.compile(r"^\s*(?://|#).*$|,(?=\s*[\]}])", re.MULTILINE)  # remarks, and a comma behind the last element


class _Loader(getattr(yaml, "CSafeLoader", yaml.SafeLoader)):  # type: ignore[misc]
    """The safe loader, which knows OpenCV's matrices as well."""


_Loader.add_constructor("tag:yaml.org,2002:opencv-matrix", lambda loader, node: loader.construct_mapping(node, True))


def read_json(content: bytes, origin: str) -> Any:
    """The data of a JSON text. Raises DocumentError."""
    text = decode(content, origin)
    try:
        return json.loads(text)
    except json.JSONDecodeError as error:
        if (spared := _SPARE.sub("", text)) != text:
            return read_json(spared.encode(), origin)
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


def read_xml_tree(content: bytes, origin: str, heading: str = "robot-poses") -> Any:
    """An XML file as mappings by tag; repeated tags are a list, and so are numbers. Raises DocumentError."""
    return _tree(read_xml(decode(content, origin), origin, heading), 0)


def _tree(element: ElementTree.Element, depth: int) -> Any:
    if not len(element) or depth > MAX_XML_DEPTH:
        text = (element.text or "").strip()
        return text.split() if len(text.split()) > 1 else text or dict(element.attrib)
    tree: dict[str, Any] = {}
    for child in element:
        tree.setdefault(child.tag, []).append(_tree(child, depth + 1))
    return {tag: values[0] if len(values) == 1 else values for tag, values in tree.items()}


def read_python(content: bytes, origin: str) -> Any:
    """The numbers that a Python source assigns or appends to names, by the names; nothing is run. DocumentError."""
    found: dict[str, Any] = {}
    if len(content) > MAX_SOURCE_BYTES:
        raise refusal(origin, "file", "more than 1 MB of Python", "write the poses as JSON or CSV")
    try:
        nodes = [*ast.walk(ast.parse(_ARRAY.sub("", decode(content, origin))))]
    except DAMAGED as error:
        raise refusal(origin, "file", f"not Python ({str(error)[:80]})", "write the poses as JSON or CSV") from None
    for node in nodes:
        with contextlib.suppress(*DAMAGED):
            match node:
                case ast.Assign(targets=[ast.Name(id=name)]):
                    found[name] = ast.literal_eval(node.value)
                case ast.Call(func=ast.Attribute(value=ast.Name(id=name), attr="append"), args=[value]):
                    found.setdefault(name, []).append(ast.literal_eval(value))
    return json.loads(json.dumps(found, default=str))  # tuples as lists
