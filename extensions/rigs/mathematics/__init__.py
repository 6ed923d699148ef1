"""Mathematics of rigs: no device, clock or framework."""
