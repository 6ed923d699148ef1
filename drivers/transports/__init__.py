"""Byte transports to devices: TCP and serial lines."""
