"""Image points of the target: usable corners of every view, reprojection residuals, the target's pose in each view."""
