"""Files, images, settings and shipped resources: bounded reading, atomic writing."""
