"""Hand-eye calibration from pairs of poses alone: residuals, noise models, and the most likely X."""
