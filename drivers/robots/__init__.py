"""Robot drivers: helpers here, one folder per brand."""
