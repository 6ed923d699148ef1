"""Rigs: several cameras and scanners on one mount, solved together and placed by their names."""
