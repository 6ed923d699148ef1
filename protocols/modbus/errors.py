"""Errors of Modbus."""

from protocols.modbus.codes import ExceptionCode


class ModbusException(Exception):
    """A complete request is answered with exception code `code`."""

    def __init__(self, code: ExceptionCode, what: str) -> None:
        self.code, self.what = code, what
        super().__init__(f"{code.name}: {what}")


class HeaderBroken(Exception):
    """The bytes are no MBAP header, and frame boundaries are lost: close the connection."""
