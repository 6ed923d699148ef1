"""The PLC interface: the register map as data, and the handshake as a pure state machine."""
