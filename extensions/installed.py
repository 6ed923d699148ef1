"""Every extension of the daemon, in the order in which GET / and openapi.json list them."""

from daemon.api.extension import Extensions
from extensions.arm_identification.extension import ARM_IDENTIFICATION
from extensions.plc.extension import PLC
from extensions.rigs.extension import RIGS
from extensions.sweeps.extension import SWEEPS
from extensions.touch.extension import TOUCH

INSTALLED: Extensions = (TOUCH, SWEEPS, ARM_IDENTIFICATION, RIGS, PLC)
