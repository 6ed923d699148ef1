"""Settings of the daemon: frozen pydantic models, read once from TOML."""
