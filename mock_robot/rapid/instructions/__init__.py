"""Implementation of the controller's instructions and functions, by topic."""
