"""Checks before and beside a calibration: the computer, the settings, the headset's displays."""
