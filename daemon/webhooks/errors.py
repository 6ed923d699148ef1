"""Errors of webhooks.

DaemonError
└── SecretUnusable        a secret file cannot be read, or a secret is too short
"""

from pathlib import Path

from daemon.errors import DaemonError


class SecretUnusable(DaemonError):
    """A secret file cannot be read, or a secret is too short."""

    code = "webhook-secret"

    def __init__(self, file: Path, what: str) -> None:
        super().__init__(f"webhook secret {file}: {what}", f"make one: openssl rand -hex 32 > {file}")
