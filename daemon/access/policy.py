"""Which role a request needs: one table, the first row that fits decides."""

from daemon.access.roles import Role

ANY = "*"

POLICY: tuple[tuple[str, str, Role], ...] = (
    ("GET", "/health", Role.NOBODY),  # a monitor asks it, and it tells nothing
    ("POST", "/setup", Role.NOBODY),  # it asks for the code that only the log shows
    ("GET", "/audit", Role.ADMIN),
    ("GET", "/keys", Role.ADMIN),
    ("GET", ANY, Role.VIEWER),
    ("HEAD", ANY, Role.VIEWER),
    ("OPTIONS", ANY, Role.VIEWER),
    ("POST", "/keys", Role.ADMIN),
    ("POST", "/keys/", Role.ADMIN),
    (ANY, ANY, Role.OPERATOR),
)
"""Method, path (a path that ends with / stands for all below it), role."""


def role_needed(method: str, path: str) -> Role:
    """The least role that may do this."""
    return next(role for verb, place, role in POLICY if verb in (method, ANY) and _fits(place, path))


def _fits(place: str, path: str) -> bool:
    return place in (ANY, path) or (place.endswith("/") and len(place) > 1 and path.startswith(place))
