"""HTML from strings: whatever is not Markup is escaped, so that a name from outside stays text."""

from html import escape
from typing import Any


class Markup(str):
    """Text that is HTML already."""

    __slots__ = ()


def tag(name: str, *children: Any, **attributes: Any) -> Markup:
    """An element. Children that are not Markup are escaped, None is left out; `class_` is the attribute class."""
    given = {key.rstrip("_").replace("_", "-"): value for key, value in attributes.items() if value is not None}
    head = "".join(f' {key}="{escape(str(value), quote=True)}"' for key, value in given.items())
    return Markup(f"<{name}{head}>{join(*children)}</{name}>")


def join(*children: Any) -> Markup:
    """Children one after another, escaped unless they are Markup."""
    kept = (child for child in children if child is not None)
    return Markup("".join(child if isinstance(child, Markup) else escape(str(child)) for child in kept))


def css_string(text: str) -> str:
    """A string of CSS: only letters, digits and a little punctuation of `text` stay."""
    return '"' + "".join(letter for letter in text if letter.isalnum() or letter in " .,:_-/")[:120] + '"'
