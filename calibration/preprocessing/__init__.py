"""Steps before the estimate: corner outliers, planar pose ambiguity, image weights, target shape."""
