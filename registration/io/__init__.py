"""Reads, moves, converts and writes cloud files and streams in blocks."""
