"""Drift monitoring of the calibration in force: control chart of its verifications, alarm, schedule."""
