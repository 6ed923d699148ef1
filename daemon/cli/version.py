"""`handeyed version`: print the versions."""

import platform

import typer

from daemon.cli.output import Json, print_json

NUMERICS = ("numpy", "scipy", "opencv-python-headless")
"""Libraries whose version can change numerical results."""


def version(json: Json = False) -> None:
    """Print the version, and those of the libraries that numerical results depend on."""
    from importlib import metadata

    versions = {name: metadata.version(name) for name in ("handeyed", *NUMERICS)}
    versions["python"] = platform.python_version()
    if json:
        print_json(versions)
    else:
        typer.echo("\n".join(f"{name} {number}" for name, number in versions.items()))
