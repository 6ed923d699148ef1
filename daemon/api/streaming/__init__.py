"""Streaming of clouds over HTTP."""
