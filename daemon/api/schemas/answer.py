"""The base class of all answers, and helpers for examples in openapi.json."""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from typing import Any, Protocol, Self, TypeVar

import msgspec
from pydantic import BaseModel, ConfigDict

from daemon.errors import StorageInconsistent
from daemon.store.damaged_rows import DamagedRow
from daemon.store.documents import DocumentRecord


class Answer(BaseModel):
    """Base class of all answers."""

    model_config = ConfigDict(frozen=True)


class StoredAnswer(Answer):
    """What was stored, when and by whom; a subclass adds the field of the document."""

    id: str
    created_at: str
    created_by: str

    @classmethod
    def of_record(cls, record: DocumentRecord) -> Self:
        """Raises StorageInconsistent."""
        (name,) = cls.model_fields.keys() - StoredAnswer.model_fields.keys()
        model: Any = cls.model_fields[name].annotation
        return cls(**vars(record), **{name: record.parsed(model)})


class Identified(Protocol):
    """A row with an id, which serves as the cursor of a page."""

    @property
    def id(self) -> str: ...


Row = TypeVar("Row", bound=Identified)
Shown = TypeVar("Shown")


def documents_of(document: Callable[[Row], Shown], rows: Iterable[Row | DamagedRow]) -> Iterator[Shown | DamagedRow]:
    """Each row as its document, or in its place a DamagedRow."""
    for row in rows:
        try:
            yield row if isinstance(row, DamagedRow) else document(row)
        except StorageInconsistent:
            yield DamagedRow(row.id)


def page_json(lists: Mapping[str, Sequence[Any]], following: str | None) -> bytes:
    """The JSON of a page: the lists by their names, and the link `next`; a msgspec.Raw in them is JSON as it stands."""
    return msgspec.json.encode({**lists, "next": following}, enc_hook=_plain)


def _plain(value: Any) -> Any:
    """What is no dataclass and no plain value itself: the fields of a model, or a sentence or number as such."""
    for plain in (str, float):
        if isinstance(value, plain):
            return plain(value)
    return vars(value)


def example(**answer: Any) -> ConfigDict:
    """A `model_config` with an example for openapi.json."""
    return ConfigDict(frozen=True, json_schema_extra={"examples": [answer]})


def as_it_stands(*, optional: Collection[str] = (), **answer: Any) -> ConfigDict:
    """The `__pydantic_config__` of an answer that is a record: each field is there, but for the `optional` ones."""

    def describe(schema: dict[str, Any]) -> None:
        for field in schema["properties"].values():
            field.pop("default", None)
        schema["required"] = [name for name in schema["properties"] if name not in optional]
        schema |= {"examples": [answer]} if answer else {}

    return ConfigDict(json_schema_extra=describe)


EXAMPLE_ID, EXAMPLE_AT = "20261121-090000-3f9a1c", "2026-11-21T09:00:00.123Z"
