"""Line profilers on the flange: profiles with times, the arm's path, and sweeps in the base frame."""
