"""The benchmark: accuracy and speed, measured on this machine."""
