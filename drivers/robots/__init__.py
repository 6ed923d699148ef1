"""Robots as the daemon sees them: helpers here, one folder a brand."""
