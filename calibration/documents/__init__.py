"""The JSON documents that people and programs exchange, as strict pydantic models (mm, degrees, w first)."""
