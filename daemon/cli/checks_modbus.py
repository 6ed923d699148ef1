"""The checks of [plc] and [interlocks]: the port is free, the serial line opens, the signals can be read."""

import asyncio
import ipaddress

import serial

from daemon.cli.output import CheckResult
from daemon.config.plc_settings import InterlockSettings, PlcSerialSettings, PlcSettings
from daemon.errors import PortTaken
from daemon.http.listen_socket import LateAddresses, open_listener
from drivers.serial_errors import SERIAL_ERRORS, reason_of

CELL = "put this right at the cell"
TERMINAL = "see that the device answers there, and that [interlocks] names its unit and addresses"


async def check_interlocks(settings: InterlockSettings) -> list[CheckResult]:
    """Read each interlock signal once."""
    interlocks = settings.open()
    try:
        readings = await interlocks.readings()
    finally:
        await interlocks.close()
    return [
        CheckResult("interlock", True, f"{reading.name}: allows motion")
        if reading.allows
        else CheckResult(
            "interlock", False, f"{reading.name} {reading.why}", TERMINAL if "cannot be read" in reading.why else CELL
        )
        for reading in readings
    ]


async def check_plc(settings: PlcSettings) -> list[CheckResult]:
    """Check the TCP port, and the serial line if the settings name one."""
    lines = [check_port(settings)]
    if settings.serial is not None:
        lines.append(await asyncio.to_thread(check_line, settings.serial))
    return lines


def check_port(settings: PlcSettings) -> CheckResult:
    """Check that the port is free, and that the writers of [plc] can reach it."""
    try:
        open_listener(settings.host, settings.port, "plc").close()
    except PortTaken as error:
        return CheckResult("plc", False, error.what, error.fix)
    if late := LateAddresses(lambda: [("plc", settings.host)]).warnings():
        return CheckResult("plc", False, late[0])
    here = f"Modbus TCP can listen on {settings.host} port {settings.port}"
    if settings.motion and not settings.writers and settings.serial is None:
        return CheckResult("plc", False, f"{here}, but motion is allowed to nobody", "name the PLC in [plc] writers")
    elsewhere = [writer for writer in settings.writers if not ipaddress.ip_network(writer).is_loopback]
    if elsewhere and ipaddress.ip_address(settings.host).is_loopback:
        what = f"{here}, which {', '.join(elsewhere)} cannot reach"
        return CheckResult("plc", False, what, "set [plc] host to this PC's address in the cell's network")
    who = f"{', '.join(settings.writers)} may write" if settings.writers else "nobody may write"
    return CheckResult("plc", True, f"{here}; {who}, triggers {'may' if settings.motion else 'may not'} move the arm")


def check_line(settings: PlcSerialSettings) -> CheckResult:
    """Check that the serial line opens."""
    try:
        serial.serial_for_url(settings.port, baudrate=settings.baud, parity=settings.parity, timeout=0).close()
    except (*SERIAL_ERRORS, ValueError) as error:
        reason = getattr(error, "strerror", None) or reason_of(error)
        what = f"the line {settings.port} cannot be opened ({reason})"
        fix = "correct [plc.serial] port, baud or parity, or the rights of the daemon's user (group dialout)"
        return CheckResult("plc", False, what, fix)
    return CheckResult("plc", True, f"the line {settings.port} opens, {settings.baud} baud, as unit {settings.unit}")
