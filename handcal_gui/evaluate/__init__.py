"""Evaluation of calibrations: studies on simulated wearers, the cube test, the user test."""
