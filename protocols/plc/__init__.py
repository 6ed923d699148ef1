"""What a PLC sees of the daemon: the register map as data, and the handshake as a pure state machine."""
