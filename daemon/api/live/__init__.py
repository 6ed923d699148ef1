"""GET /live: one poller for all listeners."""
