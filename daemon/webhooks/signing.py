"""Messages signed as Standard Webhooks (standardwebhooks.com, 1.0.0): HMAC-SHA256 over id, time and body."""

import base64
import hashlib
import hmac
from collections.abc import Sequence
from pathlib import Path

from daemon.webhooks.errors import SecretUnusable

SECRET_BYTES = 32
"""As long as the hash: more is not stronger, less is weaker."""


def signed_headers(message_id: str, at_s: int, body: bytes, secrets: Sequence[bytes]) -> dict[str, str]:
    """The headers that go with a body; one signature a secret, so that a secret can be changed without a gap."""
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


def secrets_in(file: Path) -> tuple[bytes, ...]:
    """One a line, as text, or as base64 after "whsec_". Raises SecretUnusable."""
    try:
        lines = [line.strip() for line in file.read_bytes().splitlines() if line.strip()]
    except OSError as error:
        raise SecretUnusable(file, (error.strerror or str(error)).lower()) from None
    secrets = tuple(_secret(line, file) for line in lines)
    if not secrets or any(len(secret) < SECRET_BYTES for secret in secrets):
        raise SecretUnusable(file, f"each line must hold {SECRET_BYTES} bytes or more")
    return secrets


def _secret(line: bytes, file: Path) -> bytes:
    if not line.startswith(b"whsec_"):
        return line
    try:
        return base64.b64decode(line.removeprefix(b"whsec_"), validate=True)
    except ValueError:
        raise SecretUnusable(file, "what follows whsec_ is not base64") from None
