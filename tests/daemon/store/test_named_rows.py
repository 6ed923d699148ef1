"""Records as rows of a table, by the names of their fields."""

import sqlite3
from dataclasses import dataclass

import pytest

from daemon.store.listings import Table


@dataclass(frozen=True)
class Part:
    name: str
    good: bool
    holes_mm: tuple[float, ...] | None


PARTS = Table("parts", Part, compound=("holes_mm",), beside=("plant",))


def a_table() -> sqlite3.Connection:
    """With its columns in another order than the record's fields."""
    db = sqlite3.connect(":memory:")
    db.execute("CREATE TABLE parts (holes_mm TEXT, good INTEGER, plant TEXT, name TEXT)")
    return db


def test_a_record_comes_back_whatever_the_order_of_the_columns() -> None:
    db = a_table()
    stored = [Part("door", True, (1.5, 2.0)), Part("lid", False, None)]
    for part in stored:
        PARTS.insert(db, part, plant="north")
    assert [PARTS.record(row) for row in db.execute(PARTS.select)] == stored
    assert db.execute("SELECT plant, holes_mm FROM parts").fetchall() == [("north", "[1.5,2.0]"), ("north", None)]


@pytest.mark.parametrize("row", [("door", 2, None), (None, 1, None), ("door", 1, "[1.5,"), ("door", 1, '{"a": 1}')])
def test_a_row_that_is_not_what_was_stored_is_refused(row: tuple[object, ...]) -> None:
    db = a_table()
    db.execute("INSERT INTO parts (name, good, holes_mm) VALUES (?, ?, ?)", row)
    (found,) = db.execute(PARTS.select)
    with pytest.raises(ValueError):
        PARTS.record(found)
