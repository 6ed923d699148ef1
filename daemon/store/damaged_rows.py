"""Rows of the store whose columns are not what was stored: each is named by its id, and the others are read."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, TypeVar

from pydantic import BaseModel

from calibration.sentences.sentence import Sentence
from daemon.errors import StorageInconsistent

Parsed = TypeVar("Parsed")
Model = TypeVar("Model", bound=BaseModel)


@dataclass(frozen=True)
class DamagedRow:
    """In the place of a row that cannot be read."""

    id: str


@contextmanager
def parsing(name: str) -> Iterator[None]:
    """Raises StorageInconsistent, naming the row, for what the block cannot parse."""
    try:
        yield
    except (ValueError, TypeError, KeyError, AttributeError) as error:  # pydantic's and json's errors are ValueErrors
        what = Sentence("row-is-damaged", name=name)
        raise StorageInconsistent(what, Sentence("restore-others-are-sound")) from error


def parse_row(parse: Callable[[Any], Parsed], row: Any, noun: str) -> Parsed:
    """The row, whose first column is its id. Raises StorageInconsistent."""
    with parsing(f"{noun} {row[0]}"):
        return parse(row)


def parse_stored(model: type[Model], content: str, name: str) -> Model:
    """A document as it was stored. Raises StorageInconsistent."""
    with parsing(name):
        return model.model_validate_json(content)


def parse_each(parse: Callable[[Any], Parsed], rows: Iterable[Any]) -> list[Parsed | DamagedRow]:
    """Each row, whose first column is its id, or in its place a DamagedRow."""

    def parsed(row: Any) -> Parsed | DamagedRow:
        try:
            return parse_row(parse, row, "row")
        except StorageInconsistent:
            return DamagedRow(str(row[0]))

    return [parsed(row) for row in rows]


def split_damaged(page: Iterable[Parsed | DamagedRow]) -> tuple[list[Parsed], list[str]]:
    """The rows that could be read, and the ids of those that could not."""
    read, damaged = [], []
    for row in page:
        if isinstance(row, DamagedRow):
            damaged.append(row.id)
        else:
            read.append(row)
    return read, damaged
