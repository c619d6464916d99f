"""A running station: camera, headset, procedure and session together."""
