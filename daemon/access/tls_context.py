"""TLS contexts of the server and of its clients on this machine, from the certificate that the settings name."""

import ssl

from daemon.access.errors import CertificateUnusable


def server_context(certificate: str, private_key: str) -> ssl.SSLContext:
    """A server's TLS context, version 1.2 or newer, with this certificate. Raises CertificateUnusable."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.minimum_version = ssl.TLSVersion.TLSv1_2
    fix = "correct [server] certificate and private_key, or make them: handeyed tls init"
    try:
        context.load_cert_chain(certificate, private_key, password=lambda: "")
    except ssl.SSLError as error:
        reason = error.reason or "not a certificate and its key in PEM"
        raise CertificateUnusable(
            f"{certificate} with {private_key}: {reason.lower().replace('_', ' ')}", fix
        ) from None
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise CertificateUnusable(f"{certificate} with {private_key}: {reason}", fix) from None
    return context


def trusting(authority: str) -> ssl.SSLContext:
    """TLS of a client that trusts this authority (PEM) and no other. Raises CertificateUnusable."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    try:
        context.load_verify_locations(authority)
    except OSError as error:  # ssl.SSLError is one
        reason = (error.strerror or str(error)).lower()
        fix = "give one in PEM; ask as root or as the daemon's user"
        raise CertificateUnusable(f"{authority}: cannot be read ({reason})", fix) from None
    return context


def pinned(certificate: str) -> ssl.SSLContext:
    """TLS that accepts this certificate and no other, whatever names are in it. Raises CertificateUnusable."""
    context = trusting(certificate)
    context.check_hostname = False  # it is known itself, not by its name
    context.verify_flags |= ssl.VerifyFlags.VERIFY_X509_PARTIAL_CHAIN
    return context
