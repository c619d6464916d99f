"""Calibration boards: their corners in images, sets of views, and boards to print."""
