"""Removes API keys from text that is logged or leaves the cell."""

import re

KEY_FORM = r"hek_([0-9a-f]{8})_([0-9a-f]{64})"
"""An API key: its id and its secret."""

KEY_IN_TEXT = re.compile(r"hek(?:_|%5f)([0-9a-f]{8})(?:_|%5f)[0-9a-f]{8,}", re.IGNORECASE)
"""A key anywhere in a text, also one that is cut off, percent-encoded or in capitals."""


def redact_keys(text: str) -> str:
    """The text with the secret of every API key replaced; the key's id stays, so that it can be revoked."""
    return KEY_IN_TEXT.sub(r"hek_\1_[removed]", text)
