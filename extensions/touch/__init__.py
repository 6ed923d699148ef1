"""Touch tests: a tip, where it touches what the camera has seen, and the arm that brings it there."""
