"""The base class of all answers, and helpers for examples in openapi.json."""

import json
from collections.abc import Callable, Iterable, Iterator
from typing import Any, Self, TypeVar

from pydantic import BaseModel, ConfigDict

from daemon.errors import StorageInconsistent
from daemon.store.damaged_rows import DamagedRow, split_damaged
from daemon.store.documents import DocumentRecord


class Answer(BaseModel):
    """Base class of all answers."""

    model_config = ConfigDict(frozen=True)


class OfRecord(Answer):
    """An answer that is made from a stored document."""

    @classmethod
    def of_record(cls, record: DocumentRecord) -> Self:
        """Raises StorageInconsistent."""
        raise NotImplementedError


class StoredAnswer(OfRecord):
    """What was stored, when and by whom."""

    id: str
    created_at: str
    created_by: str


Stored = TypeVar("Stored", bound=Answer)


def documents_of(
    of_record: Callable[[DocumentRecord], Stored], records: Iterable[DocumentRecord]
) -> Iterator[Stored | DamagedRow]:
    """Each record as an answer, or in its place a DamagedRow."""
    for record in records:
        try:
            yield of_record(record)
        except StorageInconsistent:
            yield DamagedRow(record.id)


def documents_json(name: str, kind: type[OfRecord], page: Iterable[DocumentRecord], following: str | None) -> bytes:
    """The JSON of a page of stored documents, with the ids of those that are damaged."""
    read, damaged = split_damaged(documents_of(kind.of_record, page))
    return page_json(name, (document.model_dump_json() for document in read), following, damaged)


def page_json(
    name: str,
    items: Iterable[str],
    following: str | None,
    damaged: Iterable[str] | None = None,
    **beside: Iterable[str],
) -> bytes:
    """The JSON of a page: the list `name` of `items`, which are JSON, the lists `beside` it, and the link `next`.

    `damaged`: ids of rows that cannot be read, where the page tells them.
    """
    lists = {name: items, **beside}
    if damaged is not None:
        lists["damaged"] = map(json.dumps, damaged)
    fields = (f"{json.dumps(key)}:[{','.join(each)}]" for key, each in lists.items())
    return f'{{{",".join(fields)},"next":{json.dumps(following)}}}'.encode()


def example(**answer: Any) -> ConfigDict:
    """A `model_config` with an example for openapi.json."""
    return ConfigDict(frozen=True, json_schema_extra={"examples": [answer]})


def as_it_stands(**answer: Any) -> ConfigDict:
    """The `__pydantic_config__` of an answer that is a record with its fields: each is there, whatever its default."""

    def describe(schema: dict[str, Any]) -> None:
        for field in schema["properties"].values():
            field.pop("default", None)
        schema |= {"required": list(schema["properties"])} | ({"examples": [answer]} if answer else {})

    return ConfigDict(json_schema_extra=describe)


EXAMPLE_ID, EXAMPLE_AT = "20261121-090000-3f9a1c", "2026-11-21T09:00:00.123Z"
