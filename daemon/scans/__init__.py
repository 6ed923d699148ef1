"""Scans: uploads, registration jobs, scanner acceptance."""
