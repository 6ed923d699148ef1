"""Hand-eye calibration: pure functions of arrays. No socket, clock or file."""
