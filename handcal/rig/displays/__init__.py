"""The displays: their calibration by a grid or Gray code, and the check that they obey."""
