"""Installs the robot program of deploy/rapid on a controller over Robot Web Services, and removes it."""
