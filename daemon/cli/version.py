"""`handeyed version`: what this release is made of."""

import platform

from daemon.cli.output import Json, print_answer

NUMERICS = ("numpy", "scipy", "opencv-python-headless")
"""Libraries whose version can change numerical results."""


def version(json: Json = False) -> None:
    """Print the version, and those of the libraries that numerical results depend on."""
    from importlib import metadata

    versions = {name: metadata.version(name) for name in ("handeyed", *NUMERICS)}
    versions["python"] = platform.python_version()
    print_answer(json, versions, "\n".join(f"{name} {number}" for name, number in versions.items()))
