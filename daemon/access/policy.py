"""The role that a request requires: the first matching row of POLICY decides."""

from daemon.access.roles import Role

ANY = "*"

POLICY: tuple[tuple[str, str, Role], ...] = (
    ("GET", "/health", Role.NOBODY),  # for monitors; discloses nothing
    ("POST", "/setup", Role.NOBODY),  # protected by the set-up code in the log
    ("POST", "/session", Role.NOBODY),  # protected by the key or the pairing code in it
    ("GET", "/session", Role.NOBODY),  # who is signed in, and what is asked for
    ("DELETE", "/session", Role.NOBODY),  # ends the caller's own
    ("POST", "/session/touch", Role.VIEWER),
    ("GET", "/docs/*", Role.NOBODY),  # static files
    ("GET", "/page/*", Role.NOBODY),  # static files; the page asks for a key itself
    ("GET", "/audit", Role.ADMIN),
    ("GET", "/audit/verified", Role.ADMIN),
    ("GET", "/keys", Role.ADMIN),
    ("POST", "/keys", Role.ADMIN),
    ("POST", "/keys/*", Role.ADMIN),
    ("GET", "/settings", Role.ADMIN),
    ("POST", "/support-bundle", Role.ADMIN),
    ("GET", "/setup", Role.ADMIN),
    ("PUT", "/setup", Role.ADMIN),
    (ANY, "/setup/*", Role.ADMIN),
    ("GET", ANY, Role.VIEWER),
    ("HEAD", ANY, Role.VIEWER),
    ("OPTIONS", ANY, Role.VIEWER),
    (ANY, ANY, Role.OPERATOR),
)
"""Method, path, role."""


def role_for(method: str, path: str) -> Role:
    """The lowest role that may make this request."""
    return next(
        role
        for verb, place, role in POLICY
        if verb in (method, ANY)
        and (place in (path, ANY) or (place.endswith("/*") and path.startswith(place[:-1])))  # /page/*: what is in it
    )
