"""Remove secrets from what leaves the cell: by the names of keys, and by the patterns of texts."""

import re
from typing import Any

from daemon.runtime.key_redaction import redact_keys

REMOVED = "[removed]"

SECRET_KEY = re.compile(r"secret|password|passwd|passphrase|token|credential|authorization|cookie|(^|_)key($|s|_)|hash")
"""Keys of settings and columns whose values are removed, at any depth."""

SECRETS: tuple[tuple[re.Pattern[str], str], ...] = (
    (re.compile(r"-----BEGIN [A-Z ]+-----.*?(-----END [A-Z ]+-----|\Z)", re.DOTALL), REMOVED),
    # user:password@ of an address, and its query
    (re.compile(r"(?P<kept>[a-z][a-z0-9+.-]{0,20}://)[^/\s\"'@]+@", re.IGNORECASE), rf"\g<kept>{REMOVED}@"),
    (re.compile(r"(?P<kept>(https?|rtsp|wss?)://[^\s\"'?#]{1,500}\?)[^\s\"']+", re.IGNORECASE), rf"\g<kept>{REMOVED}"),
    (re.compile(r"(?P<kept>\b(bearer|basic)\s+)[A-Za-z0-9._~+/=-]+", re.IGNORECASE), rf"\g<kept>{REMOVED}"),
    (
        re.compile(
            r"(?P<kept>(secret|password|passwd|passphrase|token|api[_-]?key|authorization|cookie)[\w-]{0,40}"
            r"[\"']?\s{0,9}[=:]\s{0,9})(\"[^\"]*\"|'[^']*'|[^\s,;}\]]+)",
            re.IGNORECASE,
        ),
        rf"\g<kept>{REMOVED}",
    ),
    # the one-time set-up code, and anything as long as a key
    (re.compile(r"\b[A-Z0-9]{4}(-[A-Z0-9]{4}){2,}\b"), REMOVED),
    (re.compile(r"(?<![\w/.-])[A-Za-z0-9_+=-]{32,}(?![\w/.-])"), REMOVED),
)
"""Patterns and their replacements, with bounded repetitions: a hostile log must not take quadratic time.

Long names beside a slash or a dot are kept: they are files and folders."""


def redact(text: str) -> str:
    """The text with everything that looks like a secret replaced by "[removed]"."""
    text = redact_keys(text)
    for pattern, replacement in SECRETS:
        text = pattern.sub(replacement, text)
    return text


PIECE = 1 << 16
"""Characters in which a long text is redacted: a pattern holds the interpreter, and with it the event loop."""


def redact_lines(text: str) -> str:
    """As `redact`, of a log, in pieces of whole lines; keys in PEM are removed from the whole first."""
    pem, replacement = SECRETS[0]
    lines = pem.sub(replacement, text).splitlines(keepends=True)
    pieces, length = [[]], 0  # type: list[list[str]], int
    for line in lines:
        if length > PIECE:
            pieces.append([])
            length = 0
        pieces[-1].append(line)
        length += len(line)
    return "".join(redact("".join(piece)) for piece in pieces)


def redact_values(value: Any) -> Any:
    """JSON or TOML data with the values of secret keys removed and every text redacted."""
    if isinstance(value, dict):
        return {
            redact(str(key)): REMOVED if SECRET_KEY.search(str(key).lower()) else redact_values(item)
            for key, item in value.items()
        }
    if isinstance(value, list | tuple):
        return [redact_values(item) for item in value]
    return redact(value) if isinstance(value, str) else value
