"""Many views of one part in one frame: overlap, small pose corrections, merged clouds."""
