"""What carries bytes to a device and back: TCP and serial lines, equal peers."""
