"""Drift monitoring of the active calibration: control chart of its verifications, alarm, schedule."""
