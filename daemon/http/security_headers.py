"""Headers of every answer that keep a browser from using it in other ways than the page of this daemon does."""

CONTENT_SECURITY_POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; connect-src 'self';"
    " font-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none';"
    " require-trusted-types-for 'script'; trusted-types graphics-worker"
)
"""Content Security Policy Level 3 with Trusted Types: files of this daemon only, and no text becomes a script.

The one policy, `graphics-worker` of daemon/page/scene/graphics.js, gives one address whatever it is given.
"""

SECURITY_HEADERS: dict[bytes, bytes] = {
    b"content-security-policy": CONTENT_SECURITY_POLICY.encode(),
    b"x-content-type-options": b"nosniff",
    b"referrer-policy": b"no-referrer",
    b"cross-origin-opener-policy": b"same-origin",
    b"cross-origin-resource-policy": b"same-origin",
    b"permissions-policy": b"camera=(), microphone=(), geolocation=(), usb=()",
    b"cache-control": b"no-store",
}
"""By name in lower case. An answer that names one itself keeps its own: a file that never changes may be cached."""


def with_security_headers(headers: list[tuple[bytes, bytes]]) -> list[tuple[bytes, bytes]]:
    """The headers of an answer with those of SECURITY_HEADERS that it does not have."""
    given = {name.lower() for name, _ in headers}
    return headers + [(name, value) for name, value in SECURITY_HEADERS.items() if name not in given]
