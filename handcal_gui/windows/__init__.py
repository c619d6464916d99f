"""Windows of their own: rig calibration and evaluation."""
