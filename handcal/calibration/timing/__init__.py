"""The time of an exposure: the camera's delay, measured while the head moves."""
