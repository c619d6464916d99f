"""Calibration methods that handcal is compared with: pure functions on arrays."""
