"""A headset app for any OpenXR runtime: the headset's side of a calibration, without Unity."""
