"""The commands `profiles calibrate` and `profiles register`."""
