"""X without a photograph: from a sphere seen in every view, or from surfaces that overlap."""
