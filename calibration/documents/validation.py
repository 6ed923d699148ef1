"""Parsing and validation of documents; errors carry place, what and fix of every defect."""

import difflib
import json
import reprlib
from collections.abc import Iterable, Sequence
from dataclasses import fields, is_dataclass, replace
from typing import Any, ClassVar, Literal, TypeVar, get_args, get_origin

from pydantic import BaseModel, ConfigDict, ValidationError

from calibration.errors import DocumentError, DocumentProblem
from calibration.sentences.described import Described

TOP = "document"
"""The place of the document itself."""

MAX_PROBLEMS = 20
"""Problems of a document that an error names; more are counted in one last line."""

MAX_EXACT_FLOAT = 2.0**53
"""Up to this every whole number is a float."""

MAX_NAME_LENGTH = 60
"""Characters of a name in a message; a longer one is shortened, and no similar name is searched for."""


class Document(Described, BaseModel):
    """Strict, frozen, finite: the base of every document model. The text below a field describes it in schemas."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    heading: ClassVar[str] = ""
    """Heading of docs/formats.md that describes the file; empty where the model is no file."""


Model = TypeVar("Model", bound=BaseModel)


def parse_document(model: type[Model], content: bytes, origin: str) -> Model:
    """`content` (JSON, UTF-8) as `model`; `origin` names it in errors. Raises DocumentError."""
    try:
        data = json.loads(content)
    except UnicodeDecodeError as error:
        raise _syntax_error(model, origin, f"byte {error.start}", "not UTF-8 text") from None
    except json.JSONDecodeError as error:
        place = f"line {error.lineno}, column {error.colno}"
        raise _syntax_error(model, origin, place, f"not JSON ({error.msg})") from None
    except (ValueError, RecursionError) as error:  # an integer of thousands of digits; brackets a thousand deep
        raise _syntax_error(model, origin, "document", f"beyond what is read ({error})") from None
    return validate_document(model, data, origin)


def validate_document(model: type[Model], data: Any, origin: str) -> Model:
    """`data` (as json or tomllib give it) as `model`. Raises DocumentError with the first MAX_PROBLEMS problems."""
    try:
        return model.model_validate(data)
    except ValidationError as error:
        details = error.errors(include_url=False)
        raise DocumentError(origin, with_heading(model, _problems(model, details))) from None


def _syntax_error(model: type[BaseModel], origin: str, place: str, what: str) -> DocumentError:
    return DocumentError(
        origin, with_heading(model, [DocumentProblem(place, what, "restore the file, or write it again")])
    )


def with_heading(model: type[BaseModel], problems: list[DocumentProblem]) -> list[DocumentProblem]:
    """The problems, the last of which names where the file is described."""
    heading: str = getattr(model, "heading", "")
    if not heading or not problems:
        return problems
    last = problems[-1]
    return [*problems[:-1], replace(last, fix=f"{last.fix} (docs/formats.md#{heading})")]


def validate_json(model: type[Model], data: Any, origin: str) -> Model:
    """`data` (as json gives it) as `model`, with JSON's types: "3" is no number and 1 no boolean. Raises DocumentError.

    A number like 3.0 is an integer, as in JSON Schema.
    """
    try:
        return model.model_validate_json(json.dumps(_with_integers(data)), strict=True)
    except RecursionError:
        raise DocumentError.one(origin, TOP, "it nests too deep", "send less") from None
    except ValidationError as error:
        details = error.errors(include_url=False)
        raise DocumentError(origin, _problems(model, details)) from None


def _with_integers(data: Any) -> Any:
    """`data` with integers for floats that are whole numbers."""
    if isinstance(data, float) and data.is_integer() and abs(data) < MAX_EXACT_FLOAT:
        return int(data)
    if isinstance(data, dict):
        return {key: _with_integers(value) for key, value in data.items()}
    return [_with_integers(value) for value in data] if isinstance(data, list) else data


def _problems(model: type[BaseModel], details: Sequence[Any]) -> list[DocumentProblem]:
    known = _places(model) if any(detail["type"] in _UNKNOWN_KEY for detail in details) else {}
    return limit_problems([_problem(known, detail) for detail in details[:MAX_PROBLEMS]], len(details))


def limit_problems(problems: Sequence[DocumentProblem], count: int) -> list[DocumentProblem]:
    """The first MAX_PROBLEMS of `count` problems, and one that gives the number of the others."""
    rest = count - len(problems[:MAX_PROBLEMS])
    more = [DocumentProblem(TOP, f"{rest} more problems", "correct these first")] if rest else []
    return [*problems[:MAX_PROBLEMS], *more]


def _problem(known: dict[str, set[str]], detail: Any) -> DocumentProblem:
    """`known`: the keys that may stand in each place, for an unknown one."""
    if detail["type"] in _UNKNOWN_KEY:
        return DocumentProblem(_place(detail["loc"]), "unknown key", _mend(known, detail["loc"]))
    return problem_of_detail(detail)


def problem_of_detail(detail: Any) -> DocumentProblem:
    """One of pydantic's details, with what to do about it."""
    place = _place(detail["loc"])
    if detail["type"] == "missing":
        return DocumentProblem(place, "missing", "add it")
    limits = {
        name: int(x) if isinstance(x, float) and x.is_integer() else x for name, x in detail.get("ctx", {}).items()
    }
    if (fix := _FIXES.get(detail["type"])) is not None:
        what = f"{detail['ctx']['tag']!r}" if "tag" in limits else _shown(detail["input"])
        wrong = _WRONG.get(detail["type"], "not possible").format(**limits)
        return DocumentProblem(place, f"{what} is {wrong}", fix.format(**limits))
    what, _, fix = detail["msg"].removeprefix("Value error, ").partition(": ")
    # Of an object the place says which one is meant.
    shown = "" if isinstance(detail["input"], dict | BaseModel) else f"{_shown(detail['input'])}: "
    return DocumentProblem(place, f"{shown}{what}", fix or "change what the message names")


_NUMBER, _WHOLE, _LIST, _OBJECT = "give a number", "give a whole number", "give a list", "give an object"

_UNKNOWN_KEY = ("extra_forbidden", "unexpected_keyword_argument")
"""Pydantic's types of error for a key that does not belong there: in a model, and in a dataclass."""

_FIXES = {
    "greater_than": "give more than {gt}", "greater_than_equal": "give {ge} or more",
    "less_than": "give less than {lt}", "less_than_equal": "give {le} or less",
    "literal_error": "give {expected}", "union_tag_invalid": "give one of {expected_tags}",
    "int_type": _WHOLE, "int_parsing": _WHOLE, "int_from_float": _WHOLE,
    "float_type": _NUMBER, "float_parsing": _NUMBER, "finite_number": _NUMBER,
    "bool_type": "give true or false", "bool_parsing": "give true or false", "string_type": "give text",
    "string_too_long": "give at most {max_length} characters",
    "string_too_short": "give at least {min_length} characters",
    "string_pattern_mismatch": "give what matches {pattern}",
    "list_type": _LIST, "tuple_type": _LIST, "dict_type": _OBJECT, "model_type": _OBJECT,
    "model_attributes_type": _OBJECT, "dataclass_type": _OBJECT,
    "too_long": "give at most {max_length}", "too_short": "give at least {min_length}",
    "none_required": "leave it out", "union_tag_not_found": "say of which {discriminator} it is",
}  # fmt: skip
"""What to do by pydantic's type of error; any other is ours, and says what is wrong, or what and its fix."""


_WRONG = {
    "greater_than": "not above {gt}", "greater_than_equal": "below {ge}", "less_than": "not below {lt}",
    "less_than_equal": "above {le}", "finite_number": "not finite", "union_tag_not_found": "without {discriminator}",
    "too_long": "of length {actual_length}", "too_short": "of length {actual_length}",
    "string_too_long": "longer than {max_length}", "string_too_short": "shorter than {min_length}",
}  # fmt: skip
"""What is wrong, by the same; of the others that it is not possible."""


def _place(location: tuple[int | str, ...]) -> str:
    """views[3].base_T_flange.quaternion_wxyz"""
    text = "".join(f"[{part}]" if isinstance(part, int) else f".{shortened(part)}" for part in location)
    return text.lstrip(".") or TOP


def _shown(value: Any) -> str:
    """`value` as Python writes it, but null, true and false as JSON, in at most MAX_NAME_LENGTH characters."""
    if value is None or isinstance(value, bool):
        return json.dumps(value)
    abbreviated = reprlib.Repr()
    abbreviated.maxstring = abbreviated.maxlong = abbreviated.maxother = 2 * MAX_NAME_LENGTH
    return shortened(abbreviated.repr(value))


def shortened(name: str) -> str:
    """`name` in at most MAX_NAME_LENGTH characters."""
    return name if len(name) <= MAX_NAME_LENGTH else name[: MAX_NAME_LENGTH - 3] + "..."


def nearest_fix(name: str, known: Iterable[str]) -> str | None:
    """A question that names the one of `known` most like `name`; None when none is like it."""
    if len(name) > MAX_NAME_LENGTH:
        return None
    nearest = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    return f"did you mean '{nearest[0]}'?" if nearest else None


def _mend(places: dict[str, set[str]], location: tuple[int | str, ...]) -> str:
    """What to do with an unknown key: move it to where it is known, correct its spelling, or remove it."""
    key, here = str(location[-1]), _place(tuple(part for part in location[:-1] if isinstance(part, str)))
    known = [place for place, keys in places.items() if key in keys]
    if known_in := [place for place in known if not any(place.endswith(f".{other}") for other in known)]:
        return f"move it to {' or '.join(known_in).replace(TOP, 'the top level')}, or remove it"
    beside = places.get(here, set())
    return nearest_fix(key, beside) or nearest_fix(key, set().union(*places.values())) or "remove it"


def _places(model: type) -> dict[str, set[str]]:
    """The keys that may stand in each place; list indices are left out of the place."""
    places: dict[str, set[str]] = {}
    pending: list[tuple[tuple[str, ...], type]] = [((), model)]
    while pending:
        path, kind = pending.pop(0)
        annotations = _annotations(kind)
        places[_place(path)] = set(annotations)
        for name, annotation in annotations.items():
            inner, below = _models(annotation), (*path, name)
            pending += [((*below, *_tag(one)) if len(inner) > 1 else below, one) for one in inner]
    return places


def _annotations(model: type) -> dict[str, Any]:
    """Of a model's or a dataclass's fields, by their names in the document."""
    if issubclass(model, BaseModel):
        return {field.alias or name: field.annotation for name, field in model.model_fields.items()}
    return {field.name: field.type for field in fields(model)}  # type: ignore[arg-type]


def _models(annotation: Any) -> list[type]:
    """The models and dataclasses in an annotation, through unions, lists and options."""
    if isinstance(annotation, type) and (issubclass(annotation, BaseModel) or is_dataclass(annotation)):
        return [annotation]
    return [model for inner in get_args(annotation) for model in _models(inner)]


def _tag(model: type) -> tuple[str, ...]:
    """What pydantic adds to the location of a model in a discriminated union: the value of its Literal field."""
    kinds = _annotations(model).values()
    return tuple(str(get_args(kind)[0]) for kind in kinds if get_origin(kind) is Literal)[:1]
