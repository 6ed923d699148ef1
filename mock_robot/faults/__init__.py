"""Tables of named faults, and the boards that switch them."""
