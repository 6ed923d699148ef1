"""Externally Guided Motion: what a controller tells of itself 250 times a second over UDP. Read only."""
