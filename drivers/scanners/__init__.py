"""3D scanners as the daemon sees them."""
