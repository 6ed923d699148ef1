"""The cell's devices, and the rules for motion, settling and capture."""
