"""Runs of the cell: calibration, verification, scan. At most one at a time."""
