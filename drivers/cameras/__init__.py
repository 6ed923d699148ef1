"""Cameras as the daemon sees them."""
