"""The installed version of handeyed."""

from importlib.metadata import PackageNotFoundError, version


def _version() -> str:
    try:
        return version("handeyed")
    except PackageNotFoundError:
        return "0+unknown"


VERSION = _version()
SOFTWARE = f"handeyed {VERSION}"
