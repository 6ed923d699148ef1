"""Identification of an arm's own errors from the pictures of a calibration: arm.json."""
