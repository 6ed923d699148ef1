"""Pure mathematics of eye-in-hand calibration: arrays in, results out. No socket, clock or file."""
