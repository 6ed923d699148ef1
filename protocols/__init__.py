"""Bytes to messages and back. No socket, no clock, no numpy."""
