"""Outputs of a running calibration for programs that labs already run."""
