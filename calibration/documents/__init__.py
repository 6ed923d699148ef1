"""The JSON documents as strict pydantic models: mm, degrees, quaternions with w first."""
