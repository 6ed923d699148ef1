"""X and planned poses in the notations of other systems: pure functions, one module a format, listed in `formats`."""
