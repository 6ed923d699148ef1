"""Cloud files and streams: read, moved, converted and written in blocks."""
