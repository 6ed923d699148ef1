"""Parsing and validation of documents; errors carry place, what and fix of every defect."""

import difflib
import json
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, ValidationError

from calibration.errors import DocumentError, DocumentProblem


class Document(BaseModel):
    """Strict, frozen, finite: the base of every document model."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


Model = TypeVar("Model", bound=BaseModel)


def parse_document(model: type[Model], content: bytes, origin: str) -> Model:
    """`content` (JSON, UTF-8) as `model`; `origin` names it in errors. Raises DocumentError."""
    try:
        data = json.loads(content)
    except UnicodeDecodeError as error:
        raise _syntax_error(origin, f"byte {error.start}", "not UTF-8 text") from None
    except json.JSONDecodeError as error:
        raise _syntax_error(origin, f"line {error.lineno}, column {error.colno}", f"not JSON ({error.msg})") from None
    return validate_document(model, data, origin)


def validate_document(model: type[Model], data: Any, origin: str) -> Model:
    """`data` (as json or tomllib give it) as `model`. Raises DocumentError with every problem found."""
    try:
        return model.model_validate(data)
    except ValidationError as error:
        raise DocumentError(origin, [_problem(model, detail) for detail in error.errors()]) from None


def _syntax_error(origin: str, place: str, what: str) -> DocumentError:
    return DocumentError(origin, [DocumentProblem(place, what, "restore the file, or write it again")])


def _problem(model: type[BaseModel], detail: Any) -> DocumentProblem:
    location = detail["loc"]
    match detail["type"]:
        case "extra_forbidden":
            nearest = difflib.get_close_matches(str(location[-1]), _all_keys(model), n=1, cutoff=0.5)
            fix = f"did you mean '{nearest[0]}'?" if nearest else "remove it"
            return DocumentProblem(_place(location), "unknown key", fix)
        case "missing":
            return DocumentProblem(_place(location), "missing", "add it")
        case _:
            what = f"{_short(detail['input'])}: {detail['msg'][:1].lower()}{detail['msg'][1:]}"
            return DocumentProblem(_place(location), what, "correct the value")


def _place(location: tuple[int | str, ...]) -> str:
    """views[3].base_T_flange.quaternion_wxyz"""
    text = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in location)
    return text.lstrip(".") or "document"


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 60 else text[:57] + "..."


def _all_keys(model: type[BaseModel]) -> set[str]:
    """Every key of the model and of the models within it."""
    keys: set[str] = set()
    pending: list[Any] = [model]
    seen: set[Any] = set()
    while pending:
        kind = pending.pop()
        if kind in seen:
            continue
        seen.add(kind)
        if isinstance(kind, type) and issubclass(kind, BaseModel):
            for name, field in kind.model_fields.items():
                keys.add(field.alias or name)
                pending.append(field.annotation)
        pending.extend(get_args(kind))
    return keys
