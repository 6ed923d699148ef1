"""What each extension adds to the command line, which starts without the libraries of the daemon and of `installed`."""

from collections.abc import Mapping
from types import MappingProxyType

from daemon.cli.output import CommandExtension
from extensions.arm_identification.cli import solve_arm
from extensions.rigs.cli import solve_together
from extensions.sweeps.cli.profiles import app as profiles
from extensions.touch.cli.tip import tip
from extensions.touch.cli.touch import touch

COMMANDS: Mapping[str, CommandExtension] = MappingProxyType({
    "touch": CommandExtension((tip, touch)),
    "sweeps": CommandExtension((profiles,)),
    "arm_identification": CommandExtension(after_solve={"--arm": solve_arm}),
    "rigs": CommandExtension(after_solve={"--together": solve_together}),
})  # fmt: skip
"""By the extension's name."""
