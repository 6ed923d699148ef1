"""Function codes, exception codes and limits (MODBUS Application Protocol Specification V1.1b3)."""

from enum import IntEnum

ERROR_BIT = 0x80
"""Set in the function code of an exception reply."""

MAX_READ_WORDS = 125
MAX_READ_BITS = 2000
MAX_WRITE_WORDS = 123
MAX_WRITE_BITS = 1968
MAX_READ_WRITE_WORDS = 121
MAX_PDU_BYTES = 253
"""Bytes of a request or reply without the header of its transport."""


class Function(IntEnum):
    READ_COILS = 1
    READ_DISCRETE_INPUTS = 2
    READ_HOLDING_REGISTERS = 3
    READ_INPUT_REGISTERS = 4
    WRITE_COIL = 5
    WRITE_REGISTER = 6
    WRITE_COILS = 15
    WRITE_REGISTERS = 16
    MASK_WRITE_REGISTER = 22
    READ_WRITE_REGISTERS = 23
    ENCAPSULATED = 43


class ExceptionCode(IntEnum):
    """Reasons for an exception reply. ILLEGAL_FUNCTION also refuses writes of a client that may only read."""

    ILLEGAL_FUNCTION = 1
    ILLEGAL_DATA_ADDRESS = 2
    ILLEGAL_DATA_VALUE = 3
    SERVER_DEVICE_FAILURE = 4
