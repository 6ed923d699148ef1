"""What can be wrong with a webhook's settings."""

from pathlib import Path

from daemon.errors import DaemonError


class SecretUnusable(DaemonError):
    """What messages are signed with cannot be read, or is too short."""

    code = "webhook-secret"

    def __init__(self, file: Path, what: str) -> None:
        super().__init__(f"webhook secret {file}: {what}", f"make one: openssl rand -hex 32 > {file}")
