"""From key-points and cylinders of a tracker to people."""
