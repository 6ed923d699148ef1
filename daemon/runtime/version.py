"""The installed version of handeyed."""

from importlib.metadata import PackageNotFoundError, version

try:
    VERSION = version("handeyed")
except PackageNotFoundError:
    VERSION = "0+unknown"
RELEASE = VERSION.partition(".dev")[0]
"""The release that it is, or leads to: what the interface documents state, whatever the commit."""

SOFTWARE = f"handeyed {VERSION}"
