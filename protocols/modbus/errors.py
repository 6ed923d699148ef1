"""Errors of Modbus.

ModbusError
├── RequestRefused   the request is whole, but is answered with an exception code
└── HeaderBroken     the stream is no longer Modbus TCP: close the connection
"""

from protocols.modbus.codes import ExceptionCode


class ModbusError(Exception):
    """Root."""


class RequestRefused(ModbusError):
    """The request is whole, but is answered with `code`."""

    def __init__(self, code: ExceptionCode, what: str) -> None:
        self.code, self.what = code, what
        super().__init__(f"{code.name}: {what}")


class HeaderBroken(ModbusError):
    """What came cannot be an MBAP header; nothing behind it can be trusted."""
