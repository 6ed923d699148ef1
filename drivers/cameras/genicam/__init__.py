"""Cameras of the GenICam standard: settings by its feature names (SFNC), pixel formats by its codes (PFNC)."""
