"""Moves, registers and calibrates with point clouds; pure functions and file formats, no devices."""
