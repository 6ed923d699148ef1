"""Interpreter of the RAPID modules of deploy/rapid, and checks of controller limits that a syntax check misses."""
