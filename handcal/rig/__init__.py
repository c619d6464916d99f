"""The offline calibration that everything starts from: the rig file."""
