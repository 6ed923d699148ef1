"""Line profilers on the flange: sweeps while the arm moves, and the calibration of a profiler from sweeps."""
