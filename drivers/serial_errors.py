"""What a serial port raises when it cannot be opened, or was pulled out.

pyserial wraps most of the system's errors in SerialException, but lets termios.error through, which is no OSError: from
a setting that the adapter cannot do, and from clearing the buffers of one that is gone.
"""

import termios

import serial

SERIAL_ERRORS = (serial.SerialException, OSError, termios.error)


def reason_of(error: BaseException | None) -> str:
    """The error in words: of termios.error (22, 'Invalid argument') the second half."""
    return str(error.args[-1] if isinstance(error, termios.error) else error)
