"""Scans and their registration: uploads, registration jobs, scanner acceptance."""
