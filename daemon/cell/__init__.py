"""The cell's devices and the rules for moving, settling and capturing with them."""
