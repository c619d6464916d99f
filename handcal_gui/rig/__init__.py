"""The rig wizard: the offline calibration in the window, on the functions of `handcal.rig`."""
