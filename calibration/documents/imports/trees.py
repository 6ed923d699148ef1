"""JSON, JSON lines, YAML, XML, Python's literals and pickles as plain data. YAML by PyYAML's safe loader, with no alias
or tag: an alias may repeat a list within a list without end, a tag may name a class. OpenCV's `!!opencv-matrix` is a
mapping. What a pickle calls is never run, not even numpy: arrays are put together from what stands in it.
"""

import ast
import contextlib
import io
import json
import pickle
import re
import struct
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from typing import Any

import numpy as np
import yaml

from calibration.documents.imports.refusal import DAMAGED, MAX_UNPACKED_BYTES, decode, refusal
from calibration.transforms import Array

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
    """The data of a YAML text, also of OpenCV; a list of several documents but remarks. Raises DocumentError."""
    if len(content) > MAX_YAML_BYTES:
        what = f"{len(content) / 1e6:.0f} MB of YAML, where {MAX_YAML_BYTES // 1_000_000} MB are read"
        raise refusal(origin, "file", what, "give the poses of the pictures only, or write JSON")
    text = decode(content, origin)
    if text.startswith("%YAML"):
        text = text.split("\n", 1)[1] if "\n" in text else ""
    documents = [part for part in _DOCUMENTS.split(text) if re.search(r"^[ \t]*[^\s#]", part, re.MULTILINE)]
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


_NUMBERS = re.compile(r"[<>=|][biuf][1248]")
_MADE = re.compile(r"numpy\.(dtype|ndarray|core\.\w+\.(_reconstruct|scalar|_frombuffer))|_codecs\.encode")
"""What numpy's arrays and numbers are made of in a pickle."""


@dataclass(eq=False)
class _Made:
    """What a pickle calls by one of these names, with its arguments and its state; nothing is called."""

    name: str
    args: tuple[Any, ...] = ()
    state: Any = ()

    def __call__(self, *args: Any) -> "_Made":
        return _Made(self.name, args)

    def __setstate__(self, state: Any) -> None:
        self.state = state


class _Unpickler(pickle._Unpickler):  # in Python: the one in C makes room for as many objects as a pickle numbers
    dispatch = pickle._Unpickler.dispatch | {pickle.BYTEARRAY8[0]: pickle._Unpickler.dispatch[pickle.BINBYTES8[0]]}

    def find_class(self, module: str, name: str) -> Any:
        made = f"{module}.{name}".replace("numpy._core.", "numpy.core.")
        if not _MADE.fullmatch(made):
            raise pickle.UnpicklingError(f"{module}.{name} is not read: it may run any program")
        return _Made(made)


def read_pickle(content: bytes, origin: str) -> Any:
    """The lists, mappings, numbers, texts and arrays of a pickle. Raises DocumentError, which names any other class."""
    try:
        data = _Unpickler(io.BytesIO(content), encoding="latin1").load()
        return _unpickled(data, [MAX_UNPACKED_BYTES])
    except (*DAMAGED, pickle.UnpicklingError, struct.error) as error:
        fix = "save arrays, lists and mappings of numbers, or .npz or JSON"
        raise refusal(origin, "file", f"no pickle of numbers ({str(error)[:120]})", fix) from None


def _unpickled(value: Any, left: list[int]) -> Any:
    """Plain data; `left`: the bytes that may follow, since a pickle may name a list within a list many times."""
    left[0] -= 100 + (len(value) if isinstance(value, str) else 0)
    if left[0] < 0:
        raise ValueError(f"more than {MAX_UNPACKED_BYTES // 1_000_000} MB")
    match value:
        case dict():
            return {str(key): _unpickled(one, left) for key, one in value.items()}
        case list() | tuple():
            return [_unpickled(one, left) for one in value]
        case _Made(name="_codecs.encode", args=[str(text), *_]):
            return text.encode("latin1")
        case _Made(name="numpy.core.multiarray._reconstruct", state=[_, shape, dtype, by_columns, content]):
            return _array_of(dtype, content, shape, "F" if by_columns else "C", left)
        case _Made(name="numpy.core.numeric._frombuffer", args=[content, dtype, shape, order]):
            return _array_of(dtype, content, shape, order, left)
        case _Made(name="numpy.core.multiarray.scalar", args=[dtype, content]):
            return float(_array_of(dtype, content, (), "C", left))
    return float(value) if type(value) in (int, float) else value if isinstance(value, bool | str | bytes) else None


def _array_of(dtype: _Made, content: Any, shape: Any, order: Any, left: list[int]) -> Array:
    said = f"{dtype.state[1]}{dtype.args[0]}"
    packed = _unpickled(content, left)
    packed = packed.encode("latin1") if isinstance(packed, str) else packed  # of Python 2
    if not _NUMBERS.fullmatch(said):
        raise ValueError(f"an array of {said}")
    array = np.frombuffer(packed, said).reshape(shape, order=order)
    left[0] -= array.nbytes if said == "|u1" else 8 * array.size
    return array if said == "|u1" else array.astype(float)
