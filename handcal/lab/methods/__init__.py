"""Other calibration methods, for comparison: pure functions on arrays."""
