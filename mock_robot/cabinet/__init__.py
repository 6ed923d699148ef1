"""The controller cabinet: operator panel, motors, signals."""
