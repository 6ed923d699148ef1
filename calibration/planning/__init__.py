"""Choosing calibration poses: the choice decides a factor of a hundred in the uncertainty of X."""
