"""The PLC's door: the register map served over Modbus TCP and RTU, and what its triggers start."""
