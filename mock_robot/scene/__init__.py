"""What camera and scanner see: optics, printed target, part."""
