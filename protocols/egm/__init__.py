"""Externally Guided Motion: the controller's feedback at 250 Hz over UDP. Read only."""
