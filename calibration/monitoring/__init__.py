"""After calibration: scatter of the target over verification views, and the control chart of verifications."""
