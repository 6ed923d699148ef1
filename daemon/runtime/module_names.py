"""Names of our own modules: in a wheel the rooms are below the package `handeyed`, in the repository they are not."""

BELOW = __name__.removesuffix("daemon.runtime.module_names")
"""`handeyed.` in a wheel, nothing in the repository."""


def module_name(name: str) -> str:
    """The name under which `name`, as daemon.cli, is imported here."""
    return BELOW + name
