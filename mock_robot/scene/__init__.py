"""Scene seen by camera and scanner: optics, printed target, part."""
