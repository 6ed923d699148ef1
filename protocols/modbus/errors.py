"""Errors of Modbus.

ModbusError
├── ModbusException   a complete request is answered with an exception code
└── HeaderBroken      the stream can no longer be split into frames: close the connection
"""

from protocols.modbus.codes import ExceptionCode


class ModbusError(Exception):
    """Root of the Modbus errors."""


class ModbusException(ModbusError):
    """A complete request is answered with exception code `code`."""

    def __init__(self, code: ExceptionCode, what: str) -> None:
        self.code, self.what = code, what
        super().__init__(f"{code.name}: {what}")


class HeaderBroken(ModbusError):
    """The bytes are no MBAP header, and frame boundaries are lost."""
