"""Camera intrinsics from views of a planar target, no robot involved."""
