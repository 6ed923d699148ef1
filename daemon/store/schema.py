"""The database schema: migrations/NN.sql, in their order. Append one, never change one that was released."""

from pathlib import Path

MIGRATIONS = tuple(file.read_text("utf-8") for file in sorted(Path(__file__).with_name("migrations").glob("*.sql")))

SCHEMA_VERSION = len(MIGRATIONS)
