"""Runs: what the arm is driven for. At most one at a time."""
