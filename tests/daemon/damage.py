"""Rows of the store that are not what was stored."""

import sqlite3
from pathlib import Path
from typing import Any

from daemon.store.database import DATABASE_NAME

NOT_JSON, OTHER_JSON, A_LIST, NO_TEXT = "{", "{}", "[1]", b"\xff\x00"
DOCUMENTS = [NOT_JSON, OTHER_JSON, A_LIST, NO_TEXT, "null"]


def damage(folder: Path, column: str, row: str, value: Any) -> Any:
    """Put `value` there; returns what was there."""
    table, _, name = column.partition(".")
    key = "scan_id" if table == "scan_views" else "id"
    with sqlite3.connect(folder / DATABASE_NAME) as database:
        (before,) = database.execute(f"SELECT {name} FROM {table} WHERE {key} = ?", (row,)).fetchone()
        database.execute(f"UPDATE {table} SET {name} = ? WHERE {key} = ?", (value, row))
    return before
