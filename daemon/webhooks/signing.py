"""Signatures after Standard Webhooks 1.0.0 (standardwebhooks.com): HMAC-SHA256 over id, time and body."""

import base64
import hashlib
import hmac
from collections.abc import Sequence
from pathlib import Path

from daemon.webhooks.errors import SecretUnusable
from registration.io.regular_file import read_regular

MIN_SECRET_BYTES = 32
"""The length of the hash: a longer secret is no stronger, a shorter one is weaker."""

MAX_FILE_BYTES = 1 << 16


def signature_headers(message_id: str, at_s: int, body: bytes, secrets: Sequence[bytes]) -> dict[str, str]:
    """The headers for a body, with one signature per secret, so that secrets can be rotated without interruption."""
    signatures = (f"v1,{signature(message_id, at_s, body, secret)}" for secret in secrets)
    return {
        "webhook-id": message_id,
        "webhook-timestamp": str(at_s),
        "webhook-signature": " ".join(signatures),
        "content-type": "application/json",
    }


def signature(message_id: str, at_s: int, body: bytes, secret: bytes) -> str:
    """Base64 of HMAC-SHA256(secret, "id.timestamp.body")."""
    content = f"{message_id}.{at_s}.".encode() + body
    return base64.b64encode(hmac.new(secret, content, hashlib.sha256).digest()).decode()


def read_secrets(file: Path) -> tuple[bytes, ...]:
    """The secrets of a file, one per line: text, or base64 after "whsec_". Raises SecretUnusable."""
    try:
        lines = [line.strip() for line in read_regular(file, MAX_FILE_BYTES).splitlines() if line.strip()]
    except OSError as error:
        raise SecretUnusable(file, (error.strerror or str(error)).lower()) from None
    secrets = tuple(_secret(line, file) for line in lines)
    if not secrets or any(len(secret) < MIN_SECRET_BYTES for secret in secrets):
        raise SecretUnusable(file, f"each line must hold {MIN_SECRET_BYTES} bytes or more")
    return secrets


def _secret(line: bytes, file: Path) -> bytes:
    if not line.startswith(b"whsec_"):
        return line
    try:
        return base64.b64decode(line.removeprefix(b"whsec_"), validate=True)
    except ValueError:
        raise SecretUnusable(file, "what follows whsec_ is not base64") from None
