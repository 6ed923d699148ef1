"""Before the estimate: outlying corners, planar pose ambiguity, image weights, target shape."""
