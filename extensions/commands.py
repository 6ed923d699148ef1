"""The commands of each extension; apart from `installed`, because a command starts without the daemon's libraries."""

from collections.abc import Mapping
from types import MappingProxyType

from daemon.cli.output import Commands
from extensions.sweeps.cli.profiles import app as profiles
from extensions.touch.cli.tip import tip
from extensions.touch.cli.touch import touch

COMMANDS: Mapping[str, Commands] = MappingProxyType({"touch": (tip, touch), "sweeps": (profiles,)})
"""By the extension's name."""
