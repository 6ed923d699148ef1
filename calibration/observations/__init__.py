"""Image points of the target: what was seen in each view, its reprojection residuals, the target pose it implies."""
