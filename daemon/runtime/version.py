"""The installed version of handeyed."""

from importlib.metadata import PackageNotFoundError, version


def _version() -> str:
    try:
        return version("handeyed")
    except PackageNotFoundError:
        return "0+unknown"


VERSION = _version()
RELEASE = VERSION.partition(".dev")[0]
"""The release that it is, or leads to: what the interface documents state, whatever the commit."""

SOFTWARE = f"handeyed {VERSION}"
