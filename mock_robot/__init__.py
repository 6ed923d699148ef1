"""Simulated cell with known ground truth: controller, arm, camera and scanner on real sockets and serial lines."""
