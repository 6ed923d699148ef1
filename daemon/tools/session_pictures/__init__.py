"""Pictures of a solved session: each image with its points and residuals, and a page of all residuals."""
