"""Wire protocols as pure code: bytes to messages and back. No socket, no clock, no numpy."""
