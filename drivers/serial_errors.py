"""Exceptions of a serial port that cannot be opened or was unplugged.

pyserial wraps most system errors in SerialException but passes on termios.error, which is no OSError: for a setting the
adapter does not support, and when clearing the buffers of one that is gone.
"""

import termios

import serial

SERIAL_ERRORS = (serial.SerialException, OSError, termios.error)


def reason_of(error: BaseException | None) -> str:
    """Text of the error: of termios.error (22, 'Invalid argument') the second half."""
    return str(error.args[-1] if isinstance(error, termios.error) else error)
