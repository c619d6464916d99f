"""How good a calibration is: studies on simulated wearers, the cube test, the user test."""
