"""Persistent storage: runs, calibrations and scans in SQLite, large files beside it."""
