"""Separate windows: rig calibration, evaluation, library and manual."""
