"""Function and exception codes (MODBUS Application Protocol Specification V1.1b3), and the limits it sets."""

from enum import IntEnum

ERROR_BIT = 0x80
"""A reply with an exception code carries its request's function code with this bit set."""

READ_WORDS_MOST = 125
READ_BITS_MOST = 2000
WRITE_WORDS_MOST = 123
WRITE_BITS_MOST = 1968
READ_WRITE_WORDS_MOST = 121
PDU_MOST = 253
"""Bytes of a request or reply without its transport's envelope."""


class Function(IntEnum):
    """What may be asked here."""

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
    """Why a request is not done. ILLEGAL_FUNCTION is also the answer to a client that may not write."""

    ILLEGAL_FUNCTION = 1
    ILLEGAL_DATA_ADDRESS = 2
    ILLEGAL_DATA_VALUE = 3
    SERVER_DEVICE_FAILURE = 4
