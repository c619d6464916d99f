"""When a frame was exposed: the camera's delay, measured while the head moves."""
