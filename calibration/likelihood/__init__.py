"""Maximum likelihood over pixels and robot poses: X, the target's pose, robot corrections, intrinsics, noise levels."""
