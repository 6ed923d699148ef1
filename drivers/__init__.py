"""Devices as the daemon sees them: the only owner of sockets, serial ports and cameras."""
