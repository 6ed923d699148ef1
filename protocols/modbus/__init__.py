"""Modbus: requests and replies as data, the TCP header, numbers in registers. No socket, no clock."""
