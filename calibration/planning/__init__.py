"""Choice of calibration poses; between poor and good poses the uncertainty of X differs by a factor of a hundred."""
