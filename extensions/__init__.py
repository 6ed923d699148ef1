"""Abilities beside the core, one folder each. Of the core only the composition roots import them."""
