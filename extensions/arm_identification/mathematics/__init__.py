"""Mathematics of the identification: no device, clock or framework."""
