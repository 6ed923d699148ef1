"""The simulated arm: paths, speed profiles, motion in time."""
