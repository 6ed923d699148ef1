"""The simulated arm: paths, speed profiles, position over time."""
