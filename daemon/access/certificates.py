"""Self-issued TLS certificates: an authority made for one certificate, whose private key is then discarded.

Clients trust `authority.pem`. No second certificate can be issued under it, because its key no longer exists.
"""

import ipaddress
import os
from collections.abc import Sequence
from datetime import datetime, timedelta
from pathlib import Path

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from daemon.access.errors import CertificateUnusable
from daemon.runtime.durable_files import make_folder
from drivers.transports.late_address import is_address
from registration.io.durable_file import fsync_path

CERTIFICATE, PRIVATE_KEY, AUTHORITY = "certificate.pem", "private_key.pem", "authority.pem"
DEFAULT_DAYS = 3650
"""Ten years: cells run that long, and whoever can read the key file controls the machine anyway."""

THIS_MACHINE = ("localhost", "127.0.0.1", "::1")
"""Names in every certificate: who is on the PC asks by them."""

CLOCK_TOLERANCE = timedelta(days=1)
"""The certificate is valid from this long before now, for clients whose clock is slow."""


def make_certificate(folder: Path, hosts: Sequence[str], now: datetime, days: int = DEFAULT_DAYS) -> None:
    """Write certificate, private key and authority for `hosts` (names or addresses) into `folder`.

    It is also for this machine's own names for itself, THIS_MACHINE.

    Raises CertificateUnusable, also when one of the files exists: none is overwritten.
    """
    for name in (CERTIFICATE, PRIVATE_KEY, AUTHORITY):
        if (folder / name).exists():
            raise CertificateUnusable(f"{folder / name} is there already", "move it away first, or give another --out")
    authority_key, key = ec.generate_private_key(ec.SECP256R1()), ec.generate_private_key(ec.SECP256R1())
    authority = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, f"handeyed on {hosts[0]}"[:64])])
    subject = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, hosts[0][:64])])
    every = dict.fromkeys((*hosts, *THIS_MACHINE))
    names = [x509.IPAddress(ipaddress.ip_address(one)) if is_address(one) else x509.DNSName(one) for one in every]
    begins, ends = now - CLOCK_TOLERANCE, now + timedelta(days=days)
    root = (
        _builder(authority, authority, authority_key, begins, ends)
        .add_extension(x509.BasicConstraints(ca=True, path_length=0), critical=True)
        .add_extension(_usage(sign_certificates=True), critical=True)
        .sign(authority_key, hashes.SHA256())
    )
    leaf = (
        _builder(subject, authority, key, begins, ends)
        .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
        .add_extension(_usage(sign_certificates=False), critical=True)
        .add_extension(x509.ExtendedKeyUsage([ExtendedKeyUsageOID.SERVER_AUTH]), critical=False)
        .add_extension(x509.SubjectAlternativeName(names), critical=False)
        .add_extension(x509.AuthorityKeyIdentifier.from_issuer_public_key(authority_key.public_key()), critical=False)
        .sign(authority_key, hashes.SHA256())
    )
    pem = serialization.Encoding.PEM
    secret = key.private_bytes(pem, serialization.PrivateFormat.PKCS8, serialization.NoEncryption())
    try:
        make_folder(folder, 0o755)
        _write_new(folder / PRIVATE_KEY, secret, 0o600)
        _write_new(folder / AUTHORITY, root.public_bytes(pem), 0o644)
        _write_new(folder / CERTIFICATE, leaf.public_bytes(pem), 0o644)
        fsync_path(folder)
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise CertificateUnusable(f"{folder} cannot be written ({reason})", "give another --out") from None


def _builder(
    subject: x509.Name, issuer: x509.Name, key: ec.EllipticCurvePrivateKey, begins: datetime, ends: datetime
) -> x509.CertificateBuilder:
    return (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(issuer)
        .public_key(key.public_key())
        .serial_number(x509.random_serial_number())
        .not_valid_before(begins)
        .not_valid_after(ends)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key.public_key()), critical=False)
    )


def _usage(*, sign_certificates: bool) -> x509.KeyUsage:
    return x509.KeyUsage(
        digital_signature=not sign_certificates,
        key_cert_sign=sign_certificates,
        crl_sign=sign_certificates,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        encipher_only=False,
        decipher_only=False,
    )


def _write_new(file: Path, content: bytes, mode: int) -> None:
    descriptor = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode)
    with os.fdopen(descriptor, "wb") as out:
        out.write(content)
        out.flush()
        os.fsync(out.fileno())
