"""What survives: runs, calibrations and scans in SQLite, big files beside it."""
