"""Mathematics of sweeps: no device, clock or framework."""
