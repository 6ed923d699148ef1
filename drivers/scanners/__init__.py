"""3D scanner drivers."""
