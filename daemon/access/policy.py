"""The role that a request requires: the first matching row of POLICY decides."""

from daemon.access.roles import Role

ANY = "*"

POLICY: tuple[tuple[str, str, Role], ...] = (
    ("GET", "/health", Role.NOBODY),  # for monitors; discloses nothing
    ("POST", "/setup", Role.NOBODY),  # protected by the set-up code in the log
    ("GET", "/audit", Role.ADMIN),
    ("GET", "/keys", Role.ADMIN),
    ("GET", ANY, Role.VIEWER),
    ("HEAD", ANY, Role.VIEWER),
    ("OPTIONS", ANY, Role.VIEWER),
    ("POST", "/keys", Role.ADMIN),
    ("POST", "/keys/", Role.ADMIN),
    (ANY, ANY, Role.OPERATOR),
)
"""Method, path (one that ends with / stands for all paths below it), role."""


def role_for(method: str, path: str) -> Role:
    """The lowest role that may make this request."""
    return next(role for verb, place, role in POLICY if verb in (method, ANY) and _fits(place, path))


def _fits(place: str, path: str) -> bool:
    return place in (ANY, path) or (place.endswith("/") and len(place) > 1 and path.startswith(place))
