"""Pairs of poses as measurements: their residuals, what may be wrong with them, and the likeliest X."""
