"""Secrets are taken out of everything that leaves the cell: by the name of a key, and by what a text looks like."""

import re
from typing import Any

REMOVED = "[removed]"

SECRET_KEY = re.compile(r"secret|password|passwd|passphrase|token|credential|authorization|cookie|(^|_)key($|s|_)|hash")
"""Names of settings and columns whose value is not shown, wherever they stand."""

SECRETS: tuple[tuple[re.Pattern[str], str], ...] = (
    (re.compile(r"-----BEGIN [A-Z ]+-----.*?(-----END [A-Z ]+-----|\Z)", re.DOTALL), REMOVED),
    # user:password@ of an address, and whatever its query says
    (re.compile(r"(?P<kept>[a-z][a-z0-9+.-]*://)[^/\s\"'@]+@", re.IGNORECASE), rf"\g<kept>{REMOVED}@"),
    (re.compile(r"(?P<kept>(https?|rtsp|wss?)://[^\s\"'?#]+\?)[^\s\"']+", re.IGNORECASE), rf"\g<kept>{REMOVED}"),
    (re.compile(r"(?P<kept>\b(bearer|basic)\s+)[A-Za-z0-9._~+/=-]+", re.IGNORECASE), rf"\g<kept>{REMOVED}"),
    (
        re.compile(
            r"(?P<kept>\b[\w-]*(secret|password|passwd|passphrase|token|api[_-]?key|authorization|cookie)[\w-]*"
            r"[\"']?\s*[=:]\s*)(\"[^\"]*\"|'[^']*'|[^\s,;}\]]+)",
            re.IGNORECASE,
        ),
        rf"\g<kept>{REMOVED}",
    ),
    # the one-time set-up code, and anything as long as a key
    (re.compile(r"\b[A-Z0-9]{4}(-[A-Z0-9]{4}){2,}\b"), REMOVED),
    (re.compile(r"(?<![\w/.-])[A-Za-z0-9_+=-]{32,}(?![\w/.-])"), REMOVED),
)
"""Names of files and folders may be long: what has a slash or a dot beside it is kept."""


def redacted(text: str) -> str:
    """The text without what looks like a secret."""
    for pattern, replacement in SECRETS:
        text = pattern.sub(replacement, text)
    return text


def without_secrets(value: Any) -> Any:
    """Data as JSON or TOML give it, without the values of secret keys, and every text redacted."""
    if isinstance(value, dict):
        return {
            key: REMOVED if SECRET_KEY.search(str(key).lower()) else without_secrets(item)
            for key, item in value.items()
        }
    if isinstance(value, list | tuple):
        return [without_secrets(item) for item in value]
    return redacted(value) if isinstance(value, str) else value
