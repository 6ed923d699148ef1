"""A certificate for the tests, and a client that trusts its authority."""

import ssl
from datetime import UTC, datetime
from pathlib import Path

from daemon.access.certificates import AUTHORITY, CERTIFICATE, PRIVATE_KEY, make_certificate

HOSTS = ["localhost", "127.0.0.1", "cell-7.plant.example"]


def certificate(folder: Path) -> dict[str, str]:
    make_certificate(folder, HOSTS, datetime.now(UTC))
    return {"certificate": str(folder / CERTIFICATE), "private_key": str(folder / PRIVATE_KEY)}


def trusting(folder: Path) -> ssl.SSLContext:
    context = ssl.create_default_context(cafile=str(folder / AUTHORITY))
    context.verify_flags |= ssl.VERIFY_X509_STRICT
    return context
