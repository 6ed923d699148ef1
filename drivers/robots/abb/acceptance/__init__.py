"""Acceptance of a controller: each assumption of docs/rapid.md is checked on the wire."""
