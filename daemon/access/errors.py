"""Errors of keys, roles and certificates."""

from daemon.errors import DaemonError


class KeyMissing(DaemonError, code="key-missing"):
    """The request carries no key, or one that is not valid."""

    def __init__(self, what: str) -> None:
        super().__init__(what, 'send "Authorization: Bearer KEY"; an admin makes keys with: handeyed keys add')


class RoleTooLow(DaemonError, code="role-too-low"):
    """The key is valid, but may not do this."""

    def __init__(self, name: str, role: str, needed: str, fix: str | None = None) -> None:
        super().__init__(f"{name!r} is {role}, and this needs {needed}", fix or f"ask with a key of role {needed}")


class SetupRefused(DaemonError, code="setup-refused"):
    """This is not the set-up code, or there are keys already."""


class CertificateUnusable(DaemonError, code="certificate-unusable"):
    """No server can be started with this certificate."""


class PairingRefused(DaemonError, code="pairing-refused"):
    """This pairing code signs nobody in, or none can be made."""


class TooManyAttempts(DaemonError, code="too-many-attempts"):
    """Too many attempts to sign in from this address."""

    def __init__(self) -> None:
        super().__init__("too many attempts to sign in came from this address", "wait a minute, and try again")


class KeyExists(DaemonError, code="key-exists"):
    """A key of that name is there already."""
