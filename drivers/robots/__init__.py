"""ABB controllers as the daemon sees them."""
