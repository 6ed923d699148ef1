"""ABB controllers: the CB link, Robot Web Services and EGM."""
