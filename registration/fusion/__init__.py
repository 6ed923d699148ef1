"""Fuses views of one part: overlap, small pose corrections, merged clouds."""
