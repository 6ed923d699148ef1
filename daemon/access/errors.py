"""Errors of keys, roles and certificates."""

from daemon.errors import DaemonError


class KeyMissing(DaemonError):
    """The request carries no key, or one that is not valid."""

    code = "key-missing"

    def __init__(self, what: str) -> None:
        super().__init__(what, 'send "Authorization: Bearer KEY"; an admin makes keys with: handeyed keys add')


class RoleTooLow(DaemonError):
    """The key is valid, but may not do this."""

    code = "role-too-low"

    def __init__(self, name: str, role: str, needed: str, fix: str | None = None) -> None:
        super().__init__(f"{name!r} is {role}, and this needs {needed}", fix or f"ask with a key of role {needed}")


class SetupRefused(DaemonError):
    """This is not the set-up code, or there are keys already."""

    code = "setup-refused"


class CertificateUnusable(DaemonError):
    """No server can be started with this certificate."""

    code = "certificate-unusable"


class PairingRefused(DaemonError):
    """This pairing code signs nobody in, or none can be made."""

    code = "pairing-refused"


class TooManyAttempts(DaemonError):
    """Too many attempts to sign in from this address."""

    code = "too-many-attempts"

    def __init__(self) -> None:
        super().__init__("too many attempts to sign in came from this address", "wait a minute, and try again")


class KeyExists(DaemonError):
    """A key of that name is there already."""

    code = "key-exists"
