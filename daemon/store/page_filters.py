"""Filters of the lists of runs, calibrations and scans, as conditions of their queries."""

from collections.abc import Mapping
from dataclasses import dataclass
from urllib.parse import urlencode

CONDITIONS: dict[str, str] = {
    "kind": "kind = ?",
    "state": "state = ?",
    "since": "created_at >= ?",
    "until": "created_at < ?",
    "accepted": "accepted = ?",
    "name": "instr(lower(name), lower(?)) > 0",
}
"""By the name of the query parameter. Times are compared as text: ISO 8601 in UTC sorts by time."""


@dataclass(frozen=True)
class PageFilters:
    """The filters that were given, by their names in CONDITIONS."""

    given: tuple[tuple[str, str | int], ...] = ()

    @classmethod
    def of(cls, filters: Mapping[str, str | bool | None]) -> "PageFilters":
        """Those that are not None; a truth value is stored as 0 or 1."""
        given = {name: value for name, value in filters.items() if value is not None}
        return cls(tuple((name, int(value) if isinstance(value, bool) else value) for name, value in given.items()))

    @property
    def conditions(self) -> list[str]:
        """SQL, with a place for each of `values`."""
        return [CONDITIONS[name] for name, _ in self.given]

    @property
    def values(self) -> list[str | int]:
        """The values of `conditions`, in the same order."""
        return [value for _, value in self.given]

    @property
    def query(self) -> str:
        """The same as part of a URL's query, for the link to the next page: "&kind=verify", or empty."""
        words = {name: ("true" if value else "false") if name == "accepted" else value for name, value in self.given}
        return f"&{urlencode(words)}" if words else ""


NO_FILTERS = PageFilters()
