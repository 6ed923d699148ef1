"""Rows of a table as records, by the names of their fields: a column holds the field of its name."""

import json
import sqlite3
from collections.abc import Sequence
from dataclasses import fields
from typing import Any, Generic, TypeVar

from pydantic import TypeAdapter

Record = TypeVar("Record")


class Table(Generic[Record]):
    """The rows of one table as frozen dataclasses.

    `compound`: fields that are stored as JSON; `beside`: columns that are not fields, given to `insert` and not read.
    """

    def __init__(
        self, name: str, record: type[Record], compound: Sequence[str] = (), beside: Sequence[str] = ()
    ) -> None:
        self._names = [one.name for one in fields(record)]  # type: ignore[arg-type]
        self._compound, self._adapter = compound, TypeAdapter(record)
        self._json: TypeAdapter[Any] = TypeAdapter(Any)
        columns = [*beside, *self._names]
        marks = ", ".join(f":{column}" for column in columns)
        self.select = f"SELECT {', '.join(self._names)} FROM {name}"
        self._insert = f"INSERT INTO {name} ({', '.join(columns)}) VALUES ({marks})"

    def insert(self, db: sqlite3.Connection, record: Record, **beside: Any) -> None:
        """Insert the record's row."""
        row = {name: getattr(record, name) for name in self._names}
        for name in self._compound:
            row[name] = None if row[name] is None else self._json.dump_json(row[name]).decode()
        db.execute(self._insert, row | beside)

    def record(self, row: Sequence[Any]) -> Record:
        """The record of a row of `select`. Raises ValueError for one that is not what was stored."""
        values = dict(zip(self._names, row, strict=True))
        for name in self._compound:
            values[name] = None if values[name] is None else json.loads(values[name])
        return self._adapter.validate_python(values)
