"""The sections [plc] and [interlocks] of the settings."""

import ipaddress
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import AfterValidator, Field

from calibration.documents.validation import Document
from daemon.config.server_settings import without_brackets
from drivers.transports.late_address import is_address
from protocols.modbus.words import WordOrder

if TYPE_CHECKING:
    from drivers.interlocks import Interlocks


def _validate_network(text: str) -> str:
    try:
        ipaddress.ip_network(text)
    except ValueError as error:
        raise ValueError(f"{error}: write an address, or a network as 192.168.125.0/24") from None
    return text


def _validate_address(text: str) -> str:
    if not is_address(text):
        raise ValueError("write a numeric address: 127.0.0.1, 0.0.0.0, ::")
    return text


def _validate_interlock_address(text: str) -> str:
    from drivers.interlocks import parse_interlock_address

    parse_interlock_address(text)
    return text


class PlcSerialSettings(Document):
    """Modbus RTU. `port` is a device or a pyserial URL; the client on the line may write."""

    port: Annotated[str, Field(min_length=1)]
    baud: Annotated[int, Field(ge=1200, le=921_600)] = 19200
    parity: Literal["N", "E", "O"] = "E"
    unit: Annotated[int, Field(ge=1, le=247)] = 1


class PlcSettings(Document):
    """The register map over Modbus. Without `writers` PLCs may only read; without `motion` triggers move nothing."""

    host: Annotated[str, AfterValidator(without_brackets), AfterValidator(_validate_address)] = "127.0.0.1"
    port: Annotated[int, Field(ge=0, le=65535)] = 1502
    writers: tuple[Annotated[str, AfterValidator(_validate_network)], ...] = ()
    motion: bool = False
    word_order: WordOrder = WordOrder.HIGH_FIRST
    heartbeat_limit_s: Annotated[float, Field(ge=0, le=3600)] = 0.0
    connections: Annotated[int, Field(ge=1, le=256)] = 8
    idle_limit_s: Annotated[float, Field(gt=0, le=86_400)] = 60.0
    serial: PlcSerialSettings | None = None

    def may_write(self, address: str) -> bool:
        """True when the client's address is among the writers."""
        try:
            client = ipaddress.ip_address(address.partition("%")[0])
        except ValueError:
            return False
        mapped = getattr(client, "ipv4_mapped", None) or client
        return any(mapped in ipaddress.ip_network(writer) for writer in self.writers)


class SignalSettings(Document):
    """One interlock: its Modbus address, and the value that allows motion."""

    name: Annotated[str, Field(min_length=1, max_length=60, pattern=r"^[^\x00-\x1f\x7f]*$")]
    kind: Literal["coil", "discrete-input"] = "discrete-input"
    address: Annotated[int, Field(ge=0, le=65535)]
    allows: bool = True


class InterlockSettings(Document):
    """A Modbus device whose signals allow motion, such as gate closed or part present. Not a safety function."""

    address: Annotated[str, AfterValidator(_validate_interlock_address)]
    unit: Annotated[int, Field(ge=0, le=255)] = 1
    limit_s: Annotated[float, Field(gt=0, le=10)] = 0.5
    signals: Annotated[tuple[SignalSettings, ...], Field(min_length=1, max_length=32)]

    def open(self) -> "Interlocks":
        """The Modbus client; it connects at the first reading."""
        from drivers.interlocks import Interlocks, InterlockSignal

        signals = tuple(InterlockSignal(s.name, s.kind, s.address, s.allows) for s in self.signals)
        return Interlocks(self.address, self.unit, signals, self.limit_s)
