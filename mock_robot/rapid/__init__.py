"""The RAPID modules of deploy/rapid: their grammar, and the rules a controller has that a syntax check misses."""
