"""From an image to the target's points, gated: a wrong detection is worse than none."""
