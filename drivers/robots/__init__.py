"""Robots as the daemon sees them: transports and helpers here, one folder a brand."""
