"""Mathematics of tips and touches: no device, clock or framework."""
