"""The PLC interface: the register map over Modbus TCP and RTU, and the runs that its triggers start."""
