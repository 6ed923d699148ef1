"""The commands of the gateways."""

from daemon.cli.output import Commands
from gateways.opcua.cli import opcua

COMMANDS: Commands = (opcua,)
