"""The controller's cabinet: operator panel, motors, signals."""
