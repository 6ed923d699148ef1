"""Clouds in and out over HTTP, in blocks."""
