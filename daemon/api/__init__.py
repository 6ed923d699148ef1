"""The REST interface; the only package that imports FastAPI."""
