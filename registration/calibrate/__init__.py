"""X without images: from a sphere visible in every view, or from overlapping surfaces."""
